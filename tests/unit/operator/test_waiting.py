"""Campaigns in a queue of Kueue: what is asked of it, and what is told of it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from support.kube.fake_cluster import FakeJob, World, accepted

from robovast_operator.decide import Action, CreateShard, DeleteJob, ResizeJob, SuspendJob, decide
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time
from robovast_operator.planning import shards as shards_module
from robovast_operator.pods.waiting import (
    PARKED,
    QueueFindings,
    Waiting,
    about,
    leads_elsewhere,
    place_of,
    pods_that_fit,
    wait_seconds,
    waiting_of,
)
from robovast_operator.snapshot import Snapshot

NOW = datetime(2026, 11, 21, 12, tzinfo=UTC)
TOO_MANY = (
    "couldn't assign flavors to pod set main: insufficient quota for cpu in flavor any, previously "
    "considered podsets requests (0) + current podset request (600m) > maximum capacity (250m)"
)


def job(**changes: Any) -> JobState:
    """A Job of ten packs that waits."""
    waits = FakeJob("drive-0", "shard", 10, 4, suspended=True).state()
    return replace(waits, **{"queue": "lab", **changes})


def workload(reason: str = "Pending", message: str = "", **changes: Any) -> dict[str, Any]:
    reserved = {
        "type": "QuotaReserved",
        "status": "True" if reason == "QuotaReserved" else "False",
        "reason": reason,
        "message": message,
        "observedGeneration": 1,
    }
    return {
        "metadata": {"name": "job-drive-0", "generation": 1, "annotations": {}},
        "spec": {"active": True, "podSets": [{"count": 4}], **changes},
        "status": {"conditions": [reserved]},
    }


def test_a_job_with_quota_waits_for_a_worker_cluster() -> None:
    admitted = workload("QuotaReserved")
    check = {"name": "workers", "state": "Pending", "message": "no reservation yet"}
    admitted["status"]["admissionChecks"] = [check]
    found = waiting_of(admitted, job())
    assert found is not None
    assert found.message.endswith("the admission check workers: no reservation yet.")
    assert not found.helpless
    check["state"] = "Ready"
    assert waiting_of(admitted, job()) is None


@pytest.mark.parametrize(
    ("elsewhere", "suspend", "state", "anew"),
    [
        (True, False, {"completed": "0"}, True),
        (True, False, {"active": 1}, True),
        (True, False, {}, False),
        (True, False, {"completed": "0", "suspended": False}, False),
        (True, True, {"completed": "0"}, False),
        (True, False, {"queue": "other"}, True),
        (True, True, {"queue": "other"}, False),
        (False, False, {"completed": "0"}, False),
    ],
)
def test_what_a_worker_cluster_did_not_finish_is_a_new_job_for_the_next_one(
    elsewhere: bool, suspend: bool, state: dict[str, Any], anew: bool
) -> None:
    snapshot = World(accepted(queueName="lab", suspend=suspend)).snapshot()
    (shard,) = snapshot.shards
    held = job(name=shard.job, elsewhere=elsewhere, **state)
    found = decide(replace(snapshot, jobs={held.name: held}))
    assert [a.shard for a in found.actions if isinstance(a, CreateShard)] == (
        [replace(shard, job=f"{shard.job}-1", parallelism=held.parallelism)] if anew else []
    )
    assert not any(isinstance(action, DeleteJob) for action in (*found.actions, *found.later))


def test_of_a_job_and_its_successors_the_last_counts_and_the_others_go() -> None:
    """Whatever of them the operator finds when it starts."""
    snapshot = World(accepted(queueName="lab")).snapshot()
    (shard,) = snapshot.shards
    lost = {"elsewhere": True, "active": 1, "completed": "0"}
    names = [shard.job, *(f"{shard.job}-{number}" for number in (9, 10))]
    jobs = [job(name=name, **lost) for name in names[:2]]
    jobs.append(job(name=names[2], **{**lost, "suspended": False, "completed": "0-1"}))
    seen = replace(snapshot, jobs={each.name: each for each in reversed(jobs)})
    found = decide(seen)
    assert found.actions == ()
    assert found.later == (DeleteJob(names[0]), DeleteJob(names[1]))
    assert found.status.runs.passed == 2
    assert not seen.all_ended
    stopped = replace(jobs[2], suspended=True)
    (anew,) = decide(replace(seen, jobs={stopped.name: stopped})).actions
    assert isinstance(anew, CreateShard)
    assert anew.shard.job == f"{shard.job}-11"


@pytest.mark.parametrize(
    ("elsewhere", "state", "message", "misled"),
    [
        (False, "Rejected", 'Expecting spec.managedBy to be "x" not ""', True),
        (False, "Rejected", "no capacity can be provisioned", False),
        (False, "Retry", 'Expecting spec.managedBy to be "x" not ""', False),
        (True, "Rejected", 'Expecting spec.managedBy to be "x" not ""', False),
    ],
)
def test_a_job_that_was_made_before_its_queue_led_to_other_clusters_is_made_anew(
    elsewhere: bool, state: str, message: str, misled: bool
) -> None:
    snapshot = World(accepted(queueName="lab")).snapshot()
    (shard,) = snapshot.shards
    held = job(name=shard.job, elsewhere=elsewhere)
    rejected = workload(active=False)
    rejected["status"]["admissionChecks"] = [{"state": state, "message": message}]
    waiting = waiting_of(rejected, held)
    assert waiting is not None
    assert (waiting.misled, waiting.helpless) == (misled, not misled)
    findings = QueueFindings(waiting)
    found = decide(replace(snapshot, jobs={held.name: held}, queue=findings))
    assert (DeleteJob(held.name) in found.actions) == misled


@pytest.mark.parametrize(("checks", "elsewhere"), [([], False), ([{"state": "Ready"}], True)])
def test_a_queue_without_checks_leads_nowhere_else(checks: list[Any], elsewhere: bool) -> None:
    admitted = workload("QuotaReserved")
    admitted["status"]["admissionChecks"] = checks
    assert leads_elsewhere(admitted) == elsewhere


def test_nothing_is_at_work_of_a_job_that_was_stopped_in_another_cluster() -> None:
    """Nobody brings its status any more."""
    known = {"elsewhere": True, "active": 3, "ready": 2}
    stopped, runs = job(**known), job(**known, suspended=False)
    assert (runs.pods, runs.at_work) == (3, 2)
    assert (stopped.pods, stopped.at_work, stopped.begun) == (0, 0, True)


def pending(*uids: str) -> list[dict[str, Any]]:
    """Kueue's answer; of other namespaces in the same ClusterQueue it says nothing."""
    return [
        {"metadata": {"ownerReferences": [{"uid": uid}]}, "positionInClusterQueue": index}
        for index, uid in enumerate(uids)
        if uid
    ]


def at_work(done: int, minutes: float, size: int = 10) -> JobState:
    """A Job that has done some of its packs since it started."""
    started = format_time(NOW - timedelta(minutes=minutes))
    completed = f"0-{done - 1}" if done else ""
    return job(suspended=False, started=started, completed=completed, size=size)


@pytest.mark.parametrize(
    ("message", "pods"),
    [
        (TOO_MANY, 2),
        (TOO_MANY.replace("250m", "0.45"), 4),
        (TOO_MANY.replace("250m", "0"), 0),
        (f"{TOO_MANY}, {TOO_MANY.replace('flavor any', 'flavor spot').replace('250m', '500m')}", 5),
        (f"{TOO_MANY}, {TOO_MANY.replace('cpu', 'memory').replace('600m', '6Gi')}", 0),
        ("insufficient unused quota for cpu in flavor any, 150m more needed", None),
        ("something that a later Kueue says", None),
    ],
)
def test_a_refusal_says_how_many_pods_would_fit(message: str, pods: int | None) -> None:
    assert pods_that_fit(message, 6) == pods


def test_a_refusal_that_is_not_about_the_job_as_it_is_says_nothing() -> None:
    asked = workload(message=TOO_MANY)
    now = waiting_of(asked, job())
    assert now is not None
    assert now.fits == 1
    smaller = waiting_of(asked, job(parallelism=2))
    assert smaller is not None
    assert (smaller.fits, smaller.helpless) == (None, False)
    asked["metadata"]["generation"] = 2
    older = waiting_of(asked, job())
    assert older is not None
    assert older.fits is None


@pytest.mark.parametrize(
    ("found", "waits", "reason", "remedy"),
    [
        (
            workload("Inadmissible", "LocalQueue lab doesn't exist"),
            job(),
            "QueueUnavailable",
            "lab doesn't",
        ),
        (
            workload(message=TOO_MANY.replace("250m", "0")),
            job(),
            "RunExceedsQuota",
            "`execution.resources`",
        ),
        (workload(active=False), job(), "WorkloadInactive", "suspend the Campaign"),
        (workload(), replace(job(), queue=""), "QueueRequired", "Set spec.queueName."),
    ],
)
def test_who_waits_in_vain_is_told_what_to_do(
    found: dict[str, Any], waits: JobState, reason: str, remedy: str
) -> None:
    told = waiting_of(found, waits)
    assert told is not None
    assert told.helpless
    assert told.reason == reason
    assert remedy in told.message


def test_a_workload_with_quota_does_not_wait() -> None:
    assert waiting_of(workload("QuotaReserved"), job()) is None


def test_what_we_took_out_of_a_queue_is_told_from_what_others_did() -> None:
    ours = workload(active=False)
    ours["metadata"]["annotations"] = {PARKED: "true"}
    told = waiting_of(ours, job())
    assert told is not None
    assert told.parked
    assert not told.helpless


def test_a_place_counts_all_that_wait_before_in_the_cluster_queue() -> None:
    place = place_of(pending("", "other", "uid-drive-0", "later"), job(), [], NOW)
    assert place is not None
    assert (place.position, place.pending, place.estimated_start) == (3, 4, None)
    assert place.summary == "3 of 4"
    assert place_of(pending("other"), job(), [], NOW) is None


def test_a_start_is_estimated_from_the_pace_of_those_that_run() -> None:
    halfway = at_work(done=5, minutes=10)
    place = place_of(pending("uid-drive-0"), job(), [halfway], NOW)
    assert place is not None
    assert place.estimated_start == "2026-11-21T12:10:00Z"
    assert place.summary == "1 of 1, about 10 min"
    assert wait_seconds(1, [at_work(done=0, minutes=10)], NOW) is None
    assert wait_seconds(1, [], NOW) is None
    assert wait_seconds(2, [halfway], NOW) == 30 * 60, "the one before takes 20 min, too"
    nearly = at_work(done=9, minutes=18)
    assert wait_seconds(1, [halfway, nearly], NOW) == 2 * 60
    assert wait_seconds(2, [halfway, nearly], NOW) == 10 * 60


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "less than a minute"),
        (59, "less than a minute"),
        (60, "about 1 min"),
        (720, "about 12 min"),
        (5399, "about 90 min"),
        (7200, "about 2 h"),
        (129_600, "about 2 d"),
    ],
)
def test_a_wait_is_told_no_more_precisely_than_it_is_known(seconds: float, text: str) -> None:
    assert about(seconds) == text


@pytest.fixture
def few_packs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A handful of runs needs several shards."""
    monkeypatch.setattr(shards_module, "SHARD_PACKS", 4)


class Queued(World):
    """A campaign with a queue, and what the operator knows of that."""

    def __init__(self, **spec: Any) -> None:
        self.waiting: Waiting | None = None
        self.parked: frozenset[str] = frozenset()
        super().__init__(accepted(queueName="lab", **spec))

    def snapshot(self) -> Snapshot:
        found = super().snapshot()
        jobs = {name: replace(job, queue="lab") for name, job in found.jobs.items()}
        return replace(found, jobs=jobs, queue=QueueFindings(self.waiting, self.parked))

    def decided(self) -> tuple[Action, ...]:
        return decide(self.snapshot()).actions

    def arrive(self) -> FakeJob:
        """Let the newest Job wait, as each does at first."""
        self.look()
        job = list(self.jobs.values())[-1]
        job.suspended = True
        self.waiting = Waiting(job.name, "Queued", "The campaign waits in queue lab.")
        return job


def test_one_job_of_a_campaign_waits_at_most_so_that_others_have_their_turn(
    few_packs: None,
) -> None:
    world = Queued(runs=20, parallelism=8)
    first = world.arrive()
    assert len(world.jobs) == 1
    assert world.decided() == ()
    first.suspended = False
    assert [type(action) for action in world.decided()] == [CreateShard]


def test_the_field_that_starts_and_stops_a_queued_job_is_left_to_kueue() -> None:
    world = Queued(runs=2)
    waits = world.arrive()
    assert world.decided() == (), "it is not started"
    waits.suspended = False
    assert world.decided() == ()
    waits.suspended = True
    assert world.decided() == (), "nor when Kueue has stopped it"


@pytest.mark.parametrize("at_work", [True, False])
def test_a_suspended_campaign_leaves_its_queue_once_and_comes_back_once(at_work: bool) -> None:
    world = Queued(runs=2)
    waits = world.arrive()
    waits.suspended = not at_work
    world.ask(suspend=True)
    assert world.decided() == (SuspendJob(waits.name, True),)
    world.parked, waits.suspended = frozenset({waits.name}), True
    assert world.decided() == ()
    world.ask(suspend=False)
    assert world.decided() == (SuspendJob(waits.name, False),)
    world.parked = frozenset()
    assert world.decided() == ()


def test_a_job_asks_for_no_more_than_its_queue_can_ever_give() -> None:
    world = Queued(runs=4, parallelism=12)
    waits = world.arrive()
    assert waits.parallelism == 12
    assert world.waiting is not None
    world.waiting = replace(world.waiting, fits=5)
    assert world.decided() == (ResizeJob(waits.name, 5),)
    world.waiting = replace(world.waiting, fits=None)
    world.ask(parallelism=3)
    assert world.decided() == (ResizeJob(waits.name, 3),)
    world.ask(parallelism=50)
    assert world.decided() == ()
    world.waiting = None
    world.ask(parallelism=3)
    assert world.decided() == (), "what is admitted stays as Kueue counted it"


@pytest.mark.parametrize(
    "change", [{"queue_name": "other"}, {"queue_priority_class_name": "urgent"}]
)
def test_another_queue_or_priority_takes_a_job_that_waits(change: dict[str, str]) -> None:
    world = Queued(runs=2)
    waits = world.arrive()
    world.ask(**change)
    assert world.decided() == (DeleteJob(waits.name),)
    waits.suspended = False
    assert world.decided() == ()


def test_a_campaign_waits_only_while_no_part_of_it_has_quota(few_packs: None) -> None:
    world = Queued(runs=20, parallelism=8)
    first = world.arrive()
    world.look()
    assert world.status.state == "Queued"
    assert world.truth("QuotaReserved") == "False"
    assert world.truth("Stalled") == "False"
    first.suspended = False
    world.arrive()
    world.look()
    assert world.status.state == "Running"
    assert world.truth("QuotaReserved") == "True"


def test_a_campaign_that_waits_in_vain_is_stalled() -> None:
    world = Queued(runs=2)
    waits = world.arrive()
    world.waiting = Waiting(waits.name, "QueueUnavailable", "Create the queue.", helpless=True)
    world.look()
    found = {c.type: c for c in world.status.conditions}
    assert found["Stalled"].message == found["QuotaReserved"].message == "Create the queue."
    assert found["Stalled"].status == "True"
