"""People are told once of each thing, whatever dies when."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from support.kube.fake_cluster import SETTINGS, World, accepted, campaign

from robovast.kubeapi.notice import Notice, Order
from robovast.kubeapi.resources import SUBJECTS, FailFast, Notification, Scheduling
from robovast.kubeapi.status import CampaignStatus, SearchStatus
from robovast_operator.decide import decide
from robovast_operator.kube.objects import Identity
from robovast_operator.pods.jobs import notify_job
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.pod_status import last_messages
from robovast_operator.snapshot import Snapshot
from robovast_operator.status.notices import due, interested, job_suffix, marked, notice

LASTING = timedelta(seconds=300)
PHONE = Notification(kind="ntfy", url="https://ntfy.example/topic")
IMAGE = Trouble("ImagePullFailed", "Cannot pull the image. Check the name.")
NODE = Trouble("Unschedulable", "No node can run the pod.")


class Watched(World):
    """A cluster whose operator tells people, and may be killed in the middle of that."""

    def __init__(self, receivers: Sequence[Notification] = (PHONE,), **spec: Any) -> None:
        super().__init__(accepted(**spec))
        self.receivers = receivers
        self.trouble: Trouble | None = None
        self.sent: list[Notice] = []
        self.letters: set[str] = set()
        """Names of the Jobs that are there."""

    def snapshot(self) -> Snapshot:
        found = super().snapshot()
        return replace(found, pods=replace(found.pods, trouble=self.trouble))

    def tell(self, dies: str = "") -> float | None:
        """One look, and what is told after it; the operator may die before or after the Job."""
        status = decide(self.snapshot()).status
        self.look(dies="before")
        transition, wait = due(status, self.receivers, self.now, LASTING)
        if dies == "before":
            return wait
        if transition is not None:
            name = job_suffix(transition)
            if name not in self.letters:  # the API server answers 409, which is as good
                identity = self.accepted.identity
                self.sent.append(notice(identity, status, transition, self.now))
                self.letters.add(name)
            status = marked(status, transition)
        if not dies:
            self.status = status
            for action in decide(self.snapshot()).later:
                self._act(action)
        return wait

    def wait(self, seconds: float) -> None:
        self.now += timedelta(seconds=seconds)

    def end(self, verdict: str = "passed") -> None:
        """Go on until nothing happens any more."""
        for _ in range(200):
            before = self.status
            self.tell()
            if not self.work(verdict) and before == self.status:
                return
        raise AssertionError(f"no end: {self.status}")

    def told(self) -> list[str]:
        return [sent.event for sent in self.sent]


def test_the_end_is_told_once_with_its_verdict() -> None:
    world = Watched(runs=2)
    world.end()
    world.letters.clear()  # their Jobs have expired
    for _ in range(3):
        world.wait(3600)
        world.tell()
    (sent,) = world.sent
    assert (sent.event, sent.verdict, sent.runs.passed) == ("Finished", "Passed", 6)
    assert sent.title == "drive has passed"
    assert "6 runs: 6 passed, 0 failed, 0 errored after" in sent.text
    assert "\n0 % did not pass (95 % interval 0 – 39 %)\n" in sent.text


def test_results_that_could_not_be_worked_up_are_told_beside_the_verdict() -> None:
    world = Watched(runs=1)
    world.end()
    why = {"reason": "ProcessingFailed", "message": "Postprocessing failed: no memory."}
    conditions = [
        c.model_copy(update=why if c.type == "ResultsAvailable" else {})
        for c in world.status.conditions
    ]
    status = world.status.model_copy(update={"conditions": conditions, "notified": []})
    found, _ = due(status, [PHONE], world.now, LASTING)
    assert found is not None
    sent = notice(Identity.of(campaign()), status, found, world.now)
    assert (sent.verdict, sent.reason) == ("Passed", "EnoughRunsPassed")
    assert sent.message.endswith("requires all.\nPostprocessing failed: no memory.")


def test_a_repetition_and_further_runs_end_once_more() -> None:
    world = Watched(runs=1)
    world.end("failed")
    world.ask(attempt=2)
    world.end()
    world.ask(runs=2)
    world.end()
    assert [sent.verdict for sent in world.sent] == ["Failed", "Passed", "Passed"]
    assert len({sent.id for sent in world.sent}) == 3


def test_what_was_given_up_is_told_at_once_and_not_again_when_its_results_are_complete() -> None:
    world = Watched(runs=4, fail_fast=FailFast(max_failed=1), parallelism=2)
    world.end("failed")
    assert world.truth("ResultsAvailable") == "True"
    (sent,) = world.sent
    assert (sent.event, sent.reason, sent.verdict) == ("GivenUp", "FailFast", "Failed")
    assert "spec.failFast allows 1" in sent.text


def test_trouble_is_told_when_it_lasts_once_for_each_cause_and_its_end_too() -> None:
    world = Watched(runs=3)
    world.tell()
    world.trouble = IMAGE
    wait = world.tell()
    assert wait == pytest.approx(300, abs=2)
    assert not world.sent
    for _ in range(3):
        world.wait(301)
        world.tell()
    assert [(s.event, s.reason, s.verdict) for s in world.sent] == [
        ("Stalled", "ImagePullFailed", None)
    ]
    assert "Check the name" in world.sent[0].text
    world.trouble = NODE
    world.tell()
    world.trouble = None
    for _ in range(3):
        world.wait(301)
        world.tell()
    assert world.told() == ["Stalled", "Stalled", "Recovered"]
    world.trouble = IMAGE
    for _ in range(2):
        world.tell()
        world.wait(301)
    assert world.told() == ["Stalled", "Stalled", "Recovered"]
    world.trouble = None
    world.end()
    assert world.told()[3:] == ["Finished"]


def test_what_passes_by_itself_is_not_told() -> None:
    world = Watched(runs=3)
    for trouble in (IMAGE, None) * 20:
        world.trouble = trouble
        world.tell()
        world.wait(200)
    assert world.sent == []


def test_a_campaign_that_is_not_accepted_is_trouble_as_well() -> None:
    conditions = [
        {"type": "Stalled", "status": "True", "reason": "InvalidDocument", "message": "no key `x`"},
        {"type": "Accepted", "status": "False", "reason": "InvalidDocument"},
    ]
    since = {"lastTransitionTime": "2026-11-21T08:00:00Z"}
    status = CampaignStatus.model_validate({"conditions": [c | since for c in conditions]})
    now = Watched().now
    assert due(status, [PHONE], now, LASTING) == (None, 300)
    found, _ = due(status, [PHONE], now + LASTING, LASTING)
    assert found is not None
    sent = notice(Identity.of(campaign()), status, found, now)
    assert (sent.event, sent.message, sent.seconds) == ("Stalled", "no key `x`", None)


@pytest.mark.parametrize(
    ("subjects", "told"), [(["Finished"], ["Finished"]), (["Trouble"], ["Stalled"])]
)
def test_everybody_is_told_what_they_want_to_know(subjects: list[str], told: list[str]) -> None:
    wants = Notification.model_validate(
        {"kind": "webhook", "url": "http://x/y"} | {"subjects": subjects}
    )
    world = Watched([wants], runs=2)
    world.trouble = IMAGE
    for _ in range(2):
        world.tell()
        world.wait(301)
    world.trouble = None
    world.end()
    assert world.told() == told
    given_up = Watched([wants], runs=2, fail_fast=FailFast(max_failed=0))
    given_up.end("failed")
    assert given_up.told() == ["GivenUp"]


def test_who_wants_to_follow_is_told_of_the_start_and_of_each_hour() -> None:
    wants = PHONE.model_copy(update={"subjects": ["Started", "Progress"]})
    world = Watched([wants], runs=2, parallelism=1)
    world.tell()
    world.work()
    world.tell()
    assert world.tell() == pytest.approx(3600, abs=60)
    for hours in (1, 1, 5):  # during the last of them the operator was not there
        world.wait(3600 * hours)
        for _ in range(3):
            world.tell()
    assert world.told() == ["Started", "Progress", "Progress", "Progress"]
    assert [sent.title for sent in world.sent][:2] == [
        "drive has started",
        "drive: 1 of 6 runs are done",
    ]
    assert world.sent[1].text.splitlines() == [
        "6 runs: 1 passed, 0 failed, 0 errored after 1 h 0 min",
        "0 % did not pass (95 % interval 0 – 98 %)",
        "vast exec cluster monitor",
    ]
    assert len(world.status.notified) == 2
    world.end()
    assert world.told()[4:] == []


def test_each_batch_of_a_search_is_told_with_what_it_has_found() -> None:
    wants = PHONE.model_copy(update={"subjects": ["Progress"]})
    world = Watched([wants], runs=2, parallelism=1)
    world.tell()
    world.work()
    world.tell()
    for batch in (0, 1, 1, 2):
        search = SearchStatus(batch=batch, criteria=f"batches {batch}/50", best="rate 0.9")
        status = world.status.model_copy(update={"search": search})
        found, _ = due(status, world.receivers, world.now, LASTING)
        if found is not None:
            sent = notice(Identity.of(campaign()), status, found, world.now)
            world.sent.append(sent)
            world.status = marked(status, found)
    assert [sent.title for sent in world.sent] == [
        "drive: batch 0 is scored",
        "drive: batch 1 is scored",
    ]
    assert "\nbatches 2/50 | best rate 0.9\n" in world.sent[1].text
    assert world.status.notified == ["batch-2"]


def test_a_campaign_that_waits_for_its_turn_has_not_started() -> None:
    world = Watched([PHONE.model_copy(update={"subjects": ["Started"]})], runs=2)
    world.tell()
    world.work()
    world.tell()
    waits = world.status.model_copy(update={"state": "Queued", "notified": []})
    assert due(waits, world.receivers, world.now, LASTING) == (None, None)


def test_whom_nobody_told_costs_nothing_in_the_status() -> None:
    world = Watched([], runs=2)
    world.end("failed")
    assert world.status.notified == []


steps = st.lists(
    st.tuples(
        st.sampled_from(["tell", "dies before", "dies after", "work", "trouble", "wait", "expire"]),
        st.sampled_from(["passed", "failed"]),
        st.sampled_from([None, IMAGE, NODE]),
    ),
    max_size=60,
)


@settings(max_examples=60, deadline=None)
@given(steps, st.integers(1, 4))
def test_whatever_dies_when_each_thing_is_told_by_one_job(
    happens: list[tuple[str, str, Trouble | None]], runs: int
) -> None:
    world = Watched([PHONE.model_copy(update={"subjects": [*SUBJECTS]})], runs=runs, parallelism=3)
    for kind, verdict, trouble in happens:
        match kind:
            case "tell":
                world.tell()
            case "dies before" | "dies after":
                world.tell(dies=kind.split()[1])
            case "work":
                world.work(verdict)
            case "trouble":
                world.trouble = trouble
            case "wait":
                world.wait(301)
            case "expire":  # an hour later; an operator that died in between is back by then
                world.tell()
                world.letters.clear()
    world.trouble = None
    world.end()
    # A milestone may come twice, with one id: the operator dies, then the campaign stands still.
    lasting = [sent for sent in world.sent if sent.event not in {"Started", "Progress"}]
    assert len({sent.id for sent in lasting}) == len(lasting)
    assert world.told().count("Finished") == 1
    assert len(lasting) <= 5  # two causes, each with its end, and the end of all


def order(**given: Any) -> Order:
    world = Watched(runs=1)
    world.end()
    receiver = Notification.model_validate({"kind": "ntfy", **given})
    return Order(notice=world.sent[0], receivers=[PHONE, receiver])


def test_the_job_sees_secrets_as_files_and_nothing_else() -> None:
    secret = {"name": "robovast-phone", "key": "url"}
    made = order(urlFrom=secret, tokenFrom={"name": "robovast-phone", "key": "token"})
    identity = Identity.of(campaign())
    job = notify_job(identity, SETTINGS, Scheduling(), "drive-0123-notify-a", made)
    spec, pod = job["spec"], job["spec"]["template"]["spec"]
    assert (spec["completionMode"], spec["completions"], spec["parallelism"]) == ("Indexed", 2, 2)
    assert spec["ttlSecondsAfterFinished"] > 0
    assert spec["activeDeadlineSeconds"] > 0
    assert pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    (container,) = pod["containers"]
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "capabilities": {"drop": ["ALL"]},
        "readOnlyRootFilesystem": True,
    }
    receivers = next(v for v in pod["volumes"] if v["name"] == "receivers")
    files = [
        (source["secret"]["name"], item["key"], item["path"])
        for source in receivers["projected"]["sources"]
        for item in source["secret"]["items"]
    ]
    assert files == [("robovast-phone", "url", "1/url"), ("robovast-phone", "token", "1/token")]
    assert "secretKeyRef" not in json.dumps(job)
    assert "credentials" not in {volume["name"] for volume in pod["volumes"]}


def test_the_longest_name_of_a_campaign_leaves_room_for_the_names_of_pods() -> None:
    world = Watched()
    world.end()
    found, _ = due(world.status.model_copy(update={"notified": []}), [PHONE], world.now, LASTING)
    assert found is not None
    assert interested(found, [PHONE]) == [PHONE]
    identity = replace(world.accepted.identity, name="c" * 40)
    assert len(f"{identity.child(job_suffix(found))}-4") <= 63


def test_the_longest_message_fits_into_a_message_of_ntfy() -> None:
    made = order(url="https://a/b").notice
    long = made.model_copy(update={"message": "ü" * 5000, "failing": ["v" * 300] * 10})
    assert len(long.text.encode()) <= 3500
    assert long.text.endswith(f"-i {long.campaign.name}")


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "ntfy"},
        {"kind": "ntfy", "url": "https://a/b", "urlFrom": {"name": "a", "key": "b"}},
        {"kind": "mail", "url": "https://a/b"},
        {"kind": "ntfy", "url": "ftp://a/b"},
        {"kind": "ntfy", "url": "https://a/b\r\nX: y"},
        {"kind": "ntfy", "url": "https://a/b", "subjects": []},
    ],
)
def test_a_receiver_has_one_address_of_http(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Notification.model_validate(wrong)


def test_the_last_words_of_an_index_count_and_each_is_told_once() -> None:
    def pod(index: int, created: str, words: str) -> dict[str, Any]:
        ended = {"terminated": {"exitCode": 65, "message": words}}
        return {
            "metadata": {
                "creationTimestamp": created,
                "annotations": {"batch.kubernetes.io/job-completion-index": str(index)},
            },
            "status": {"containerStatuses": [{"name": "notify", "state": ended}]},
        }

    pods = [pod(0, "1", "busy"), pod(0, "2", "gone"), pod(1, "1", "gone"), pod(2, "1", "fine")]
    assert last_messages(pods, "notify", "0-1") == ["gone"]
