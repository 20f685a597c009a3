"""Texts and Jobs of others pass on no secret, stop no operator, and lose no Job of a neighbor."""

from __future__ import annotations

import time
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS, campaign

from robovast.kubeapi.resources import CAMPAIGN_LABEL, ROLE_LABEL, UID_LABEL
from robovast_operator.effects.jobs import Jobs
from robovast_operator.kube.events import EventContent, event
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.sentences import clause
from robovast_operator.kube.store import JobState, Store
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.planning.accept import accept
from robovast_operator.pods.waiting import pods_that_fit


def identity() -> Identity:
    found = accept(shaped(campaign()), None, SETTINGS)
    assert not isinstance(found, str)
    made: Identity = found.identity  # type: ignore[union-attr]
    return made


def ended_job(name: str, uid: str, role: str) -> JobState:
    labels = {CAMPAIGN_LABEL: "drive", UID_LABEL: uid, ROLE_LABEL: role}
    metadata = {"namespace": "lab", "name": name, "uid": name, "resourceVersion": "1"}
    status = {"conditions": [{"type": "Complete", "status": "True"}]}
    return JobState.of({"metadata": {**metadata, "labels": labels}, "status": status})


def test_an_event_has_no_password_and_no_escape() -> None:
    text = "Cannot clone https://user:s3cr3t@git/x \x1b[2J."
    message = event(identity(), EventContent("Warning", "PodFailed", text, "a"), "t")["message"]
    assert "s3cr3t" not in message
    assert "user" not in message
    assert "\x1b" not in message


@pytest.mark.parametrize("role", ["notify", "share", "shard", "finish"])
def test_only_jobs_of_the_campaign_make_room_in_a_quota(role: str) -> None:
    store, obj = Store(), shaped(campaign())
    obj["status"] = {"observedGeneration": 1, "attempt": 1, "runs": {"total": 3}, "shards": []}
    store.put_campaign(obj)
    store.put_job(ended_job("copy-of-a-job", "another-uid", role))
    nothing: Any = None
    assert list(Jobs(nothing, store, nothing)._removable("lab")) == []


@pytest.mark.parametrize("amount", ["1e400", "NaN", "inf", "-1e400", "x", "", "9" * 60])
def test_amounts_that_are_no_number_fit_nothing_and_raise_nothing(amount: str) -> None:
    message = "insufficient quota for cpu in flavor f, request ({}) > maximum capacity ({})"
    for asked, most in ((amount, "1"), ("1", amount)):
        assert pods_that_fit(message.format(asked, most), 3) in {None, 0}


def test_a_long_message_costs_little_time() -> None:
    start = time.process_time()
    pods_that_fit("insufficient quota for a in flavor b, " * 8000, 3)
    assert time.process_time() - start < 0.5


@pytest.mark.parametrize("path", ["..", ".", "/data/.", "../.."])
def test_the_period_of_a_path_stays(path: str) -> None:
    assert clause(f"cannot read {path}") == f"cannot read {path}"
    assert clause(f"cannot read {path} now. ") == f"cannot read {path} now"
