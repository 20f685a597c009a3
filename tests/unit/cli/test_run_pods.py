"""What the pod of a run says of itself before there is a log."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast_cli.kube.pods import has_started, is_live, is_prepared, waiting_reason
from robovast_cli.kube.runs import CampaignRuns
from robovast_cli.kube.store import StorePlace

RUNNING = {"running": {"startedAt": "2026-11-21T08:00:00Z"}}
DONE = {"terminated": {"exitCode": 0}}
NOT_YET = {"waiting": {"reason": "PodInitializing"}}
NO_IMAGE = {"waiting": {"reason": "ImagePullBackOff", "message": "Back-off pulling"}}


def pod(started: bool, agent: Any, run: Any, **before: Any) -> Any:
    """A pod as the API server has it, with the states of its containers."""
    containers = [
        {"name": "agent", "started": started, "state": agent},
        {"name": "robovast", "started": "running" in run, "state": run},
    ]
    init = [{"name": name.replace("_", "-"), "state": state} for name, state in before.items()]
    status = {"initContainerStatuses": init, "containerStatuses": containers}
    return {"metadata": {"name": "p"}, "status": status}


@pytest.mark.parametrize(
    ("pod", "told"),
    [
        (pod(False, NOT_YET, NOT_YET, compat_version=RUNNING), "by container compat-version"),
        (pod(False, RUNNING, RUNNING, compat_version=DONE, sim=RUNNING), "by container agent"),
        (
            pod(False, NO_IMAGE, RUNNING, compat_version=DONE),
            "for container agent: ImagePullBackOff: Back-off pulling",
        ),
        (
            pod(False, NOT_YET, NOT_YET, compat_version=DONE, fetch=RUNNING),
            "by container fetch",
        ),
        (pod(False, NOT_YET, NOT_YET, istio_init=RUNNING), "waits for container istio-init"),
    ],
    ids=["version", "agent", "image", "earlier operator", "added"],
)
def test_a_pod_that_is_not_prepared_says_by_whom(pod: Any, told: str) -> None:
    assert not is_prepared(pod)
    assert waiting_reason(pod).endswith(told)


@pytest.mark.parametrize(
    "pod",
    [
        pod(True, RUNNING, RUNNING, compat_version=DONE),
        pod(False, DONE, RUNNING, compat_version=DONE),
    ],
    ids=["at work", "ended"],
)
def test_no_other_pod_is_said_to_be_in_preparation(pod: Any) -> None:
    assert is_prepared(pod)


def test_a_container_that_cannot_be_started_has_no_log_and_the_pod_says_why() -> None:
    refused = {"terminated": {"reason": "StartError", "message": "memory limit too low"}}
    found = pod(True, RUNNING, refused, compat_version=DONE)
    assert not has_started(found, "robovast")
    assert waiting_reason(found).endswith("cannot start container robovast: memory limit too low")
    assert has_started(pod(True, RUNNING, DONE), "robovast")


@pytest.mark.parametrize(
    "run", ["../x/0", "x", "", "/0", "../0", "x/../0", "x/ 0", "x/+0", "x/٣", "x\udcff/0", "x\n/0"]
)
def test_of_a_campaign_that_was_removed_nothing_but_runs_is_looked_for(run: str) -> None:
    kube: Any = None
    with ExitStack() as stack:
        runs = CampaignRuns(kube, None, "bucket", StorePlace("http://s3"), stack)
        with pytest.raises(InputError, match="is not a valid run"):
            runs.executor(run)
        assert runs.executor("hall-1/0") is None


@pytest.mark.parametrize("phase", ["Pending", "Running"])
def test_a_pod_whose_agent_has_ended_executes_no_run(phase: str) -> None:
    found = pod(False, DONE, DONE, compat_version=DONE, istio_proxy=RUNNING)
    found["status"]["phase"] = phase
    assert not is_live(found)
    found["status"]["containerStatuses"][0]["state"] = RUNNING
    assert is_live(found)
