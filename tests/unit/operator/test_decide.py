"""Whatever happens, and in whatever order: the same picture leads to the same end."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import AS_NEEDED, World, accepted, bad

from robovast.kubeapi.resources import Acceptance, FailFast, ShareTarget
from robovast_operator import snapshot as picture_module
from robovast_operator.decide import CreateShard, CreateTask, DeleteJob, decide
from robovast_operator.planning import shards as shards_module
from robovast_operator.pods.observations import PodFindings, Trouble
from robovast_operator.status import status as tell_module


@pytest.fixture(autouse=True)
def _small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a handful of runs needs several."""
    monkeypatch.setattr(shards_module, "SHARD_PACKS", 4)


def test_a_campaign_runs_every_run_once_and_ends() -> None:
    world = World(accepted(runs=10, parallelism=6))
    world.settle()
    assert world.executed == sorted(world.executed)
    assert len(world.executed) == len(set(world.executed)) == 30
    assert world.status.progress == "30/30"
    assert world.status.state == "Finished"
    assert {name: world.truth(name) for name in ("Succeeded", "Passed", "ResultsAvailable")} == {
        "Succeeded": "True",
        "Passed": "True",
        "ResultsAvailable": "True",
    }
    assert world.truth("Reconciling") == world.truth("Stalled") == "False"


moments = st.lists(
    st.tuples(
        st.sampled_from(["look", "dies before", "dies amid", "work", "vanish"]),
        st.integers(0, 5),
        st.sampled_from(["passed", "failed", "errored"]),
    ),
    max_size=60,
)


@settings(max_examples=40, deadline=None)
@given(moments, st.integers(1, 12), st.integers(1, 9))
def test_no_order_of_events_loses_a_run_or_repeats_one(
    events: list[tuple[str, int, str]], runs: int, parallelism: int
) -> None:
    world = World(accepted(runs=runs, parallelism=parallelism))
    for kind, which, verdict in events:
        world.meet(kind, which, verdict)
        names = [n for n, job in world.jobs.items() if job.role == "shard" and not job.over]
        if kind == "vanish" and names:  # somebody deletes a Job
            del world.jobs[names[which % len(names)]]
        assert world.pods <= parallelism
    world.settle()
    assert sorted(world.executed) == list(range(3 * runs))
    assert bad(world) == [i for i in range(3 * runs) if world.stored[i] != "passed"]
    assert world.status.runs.passed == 3 * runs - len(bad(world))
    assert world.status.state == "Finished"
    assert world.truth("Passed") == ("False" if bad(world) else "True")


@settings(max_examples=25, deadline=None)
@given(moments, st.integers(1, 9))
def test_no_order_of_events_changes_how_many_runs_are_needed(
    events: list[tuple[str, int, str]], parallelism: int
) -> None:
    """The first variant passes, the second fails, and the third does what happens."""
    world = World(accepted(as_needed=AS_NEEDED, parallelism=parallelism))
    fates = {0: "passed", 6: "failed"}
    for kind, which, verdict in [*events, *[("work", 0, "errored")] * 3]:
        match kind:
            case "look":
                world.look()
            case "dies before" | "dies amid":
                world.look(dies=kind.split()[1])
            case "work" if world.jobs:
                world.work_as(lambda id_, v=verdict: fates.get(id_ // 6 * 6, v), which)
        assert world.status.runs.needed >= world.status.runs.decided
    for _ in range(20):
        world.look()
        world.work_as(lambda id_: fates.get(id_ // 6 * 6, "errored"))
    runs = world.status.runs
    assert [i for i in world.stored if i < 6] == [0, 1, 2]
    assert [i for i in world.stored if 6 <= i < 12] == [6, 7]
    assert (runs.total, runs.not_needed) == (18, 18 - len(world.stored))
    assert world.status.progress == f"{len(world.stored)}/{len(world.stored)}"
    assert len(world.executed) == len(set(world.executed)) == runs.decided
    assert world.status.state == "Finished"
    assert not runs.undecided


def test_more_runs_of_undecided_configurations_begin_when_all_before_have_ended() -> None:
    """Three variants that always err stay undecided, so that another block begins after them."""
    world = World(accepted(as_needed=AS_NEEDED, parallelism=9))
    world.look()
    world.ask(runs=8)
    world.look()
    assert len(world.jobs) == 1
    world.settle("errored")
    assert world.executed == [*range(18), *range(18, 24)]
    assert world.status.runs.errored == 24


def test_without_the_words_of_their_pods_nobody_knows_how_many_runs_were_needed() -> None:
    world = World(accepted(as_needed=AS_NEEDED, parallelism=9))
    world.look()
    world.unseen[next(iter(world.jobs))] = {0, 1, 2}
    while world.work("passed"):
        pass
    world.look()
    assert (world.status.runs.passed, world.status.runs.undecided) == (0, 18)
    world.settle()
    assert (world.status.runs.passed, world.status.runs.not_needed) == (9, 9)
    assert world.truth("Passed") == "True"


@settings(max_examples=15, deadline=None)
@given(moments, st.integers(2, 6))
def test_bad_runs_alone_are_repeated_when_that_is_asked_for(
    events: list[tuple[str, int, str]], runs: int
) -> None:
    world = World(accepted(runs=runs, parallelism=3))
    for kind, which, verdict in events:
        world.meet("look" if kind == "vanish" else kind, which, verdict)
    world.settle()
    first, before = list(world.executed), bad(world)
    world.ask(attempt=2)
    world.look(dies="before")
    world.settle()
    assert sorted(world.executed[len(first) :]) == before
    assert bad(world) == []
    assert world.status.attempt == 2
    assert world.truth("Passed") == "True"
    created = len(world.created)
    world.ask(attempt=3)
    world.settle()
    assert len(world.created) == created, "nothing was bad, so nothing is to be done"
    assert world.status.attempt == 3


def test_raising_runs_appends_to_a_finished_campaign() -> None:
    world = World(accepted(runs=2))
    world.settle()
    world.ask(runs=5)
    world.look()
    assert world.truth("ResultsAvailable") == "False"
    world.settle()
    assert sorted(world.executed) == list(range(15))
    assert world.executed[:6] == list(range(6))
    assert world.status.progress == "15/15"
    assert world.truth("Passed") == "True"


def test_raising_runs_of_a_campaign_at_work_moves_nothing() -> None:
    world = World(accepted(runs=2))
    world.look()
    world.work()
    world.ask(runs=4)
    world.settle()
    assert sorted(world.executed) == list(range(12))


def test_a_suspended_campaign_has_no_pods_and_goes_on_where_it_was() -> None:
    world = World(accepted(runs=4, parallelism=4))
    world.look()
    world.work()
    world.ask(suspend=True)
    world.look()
    world.look()
    assert not world.work()
    assert world.status.state == "Suspended"
    assert world.truth("Reconciling") == "False"
    world.ask(suspend=False)
    world.settle()
    assert sorted(world.executed) == list(range(12))


def test_too_many_bad_runs_end_a_campaign_at_once() -> None:
    world = World(accepted(runs=20, parallelism=2))
    world.ask(fail_fast=FailFast(max_failed=2))
    for _ in range(3):
        world.look()
        world.work("failed")
    world.settle()
    assert world.status.state == "Failed"
    assert world.truth("Succeeded") == world.truth("Passed") == "False"
    assert world.truth("ResultsAvailable") == "True"
    assert len(world.executed) < 10
    reason = next(c.reason for c in world.status.conditions if c.type == "Succeeded")
    assert reason == "FailFast"


def test_a_verdict_that_cannot_change_any_more_is_told_early() -> None:
    world = World(accepted(runs=4, parallelism=12))
    world.ask(acceptance=Acceptance(min_pass_ratio="0.75"))
    for _ in range(3):
        world.look()
        world.work("failed")
    world.look()
    assert world.truth("Passed") == "Unknown"
    world.work("failed")
    world.look()
    assert world.truth("Passed") == "False"
    assert world.truth("Succeeded") == "Unknown"


@pytest.mark.parametrize(("ratio", "verdict"), [("0.9", "True"), ("0.95", "False")])
def test_acceptance_is_a_ratio(ratio: str, verdict: str) -> None:
    world = World(accepted(runs=10, parallelism=30))
    world.ask(acceptance=Acceptance(min_pass_ratio=ratio))
    for number in range(30):
        world.look()
        world.work("failed" if number < 3 else "passed")
    world.settle()
    assert world.truth("Passed") == verdict


def test_jobs_of_a_finished_campaign_go_after_their_time() -> None:
    world = World(accepted(runs=1))
    world.ask(ttl_seconds_after_finished=600)
    world.settle()
    assert world.jobs
    wait = world.look().again
    assert wait is not None
    assert 500 < wait <= 600
    world.now += timedelta(seconds=601)
    world.look()
    world.look()
    assert world.jobs == {}
    before = world.status
    world.look()
    assert world.status.runs == before.runs
    assert world.created == ["drive-0123-0", "drive-0123-finish-1"]


def test_a_lost_pod_is_undecided_until_the_bucket_is_read() -> None:
    world = World(accepted(runs=1))
    world.look()
    job = world.jobs["drive-0123-0"]
    job.done = {0: "lost", 1: "passed", 2: "passed"}
    world.stored = {1: "passed", 2: "passed"}
    world.look()
    runs = world.status.runs
    assert (runs.passed, runs.failed, runs.errored, runs.undecided) == (2, 0, 0, 1)
    assert world.status.progress == "2/3"
    assert world.truth("Passed") == "Unknown"
    world.settle()
    assert (world.status.runs.errored, world.status.runs.undecided) == (1, 0)
    assert world.status.errored_runs == "0"


def test_failures_that_no_pod_was_asked_about_do_not_end_a_campaign_for_errors() -> None:
    """Pods are looked at now and then only; what failed since is neither failed nor errored."""
    world = World(accepted(runs=5, parallelism=2))
    world.ask(fail_fast=FailFast(max_errored=0))
    world.look()
    world.unseen = {"drive-0123-0": {0, 1}}
    for _ in range(2):
        world.work("failed")
        world.look()
    assert world.truth("Succeeded") == "Unknown"
    runs = world.status.runs
    assert (runs.failed, runs.errored, runs.undecided) == (0, 0, 2)
    world.unseen.clear()
    world.look()
    assert (world.status.runs.failed, world.status.runs.undecided) == (2, 0)
    world.settle()
    assert world.truth("Succeeded") == "True"
    assert world.status.runs.failed == 2


@settings(max_examples=15, deadline=None)
@given(moments, st.integers(1, 8), st.sets(st.integers(0, 3)))
def test_numbers_never_say_more_than_is_known(
    events: list[tuple[str, int, str]], runs: int, unseen: set[int]
) -> None:
    world = World(accepted(runs=runs, parallelism=4))
    world.unseen = {f"drive-0123-{number}": unseen for number in range(20)}
    for kind, which, verdict in events:
        if kind == "work":
            world.work(verdict, which)
        world.look()
        told = world.status.runs
        true = [list(world.stored.values()).count(k) for k in ("passed", "failed", "errored")]
        assert told.passed <= true[0]
        assert told.failed <= true[1]
        assert told.errored <= true[2]
        assert told.decided + told.undecided <= len(world.stored)
    world.settle()
    assert world.status.runs.failed == list(world.stored.values()).count("failed")


@pytest.mark.parametrize("runs_per_job", [1, 20])
def test_all_that_was_bad_is_repeated_and_nothing_else(
    runs_per_job: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ranges of 1,000 scattered runs are longer than any status or message may be."""
    monkeypatch.setattr(shards_module, "SHARD_PACKS", 500)
    made = accepted(runs=3334, parallelism=400)
    execution = made.vast.execution.model_copy(update={"runs_per_job": runs_per_job})
    world = World(replace(made, vast=made.vast.model_copy(update={"execution": execution})))
    failed = set(range(3, 10_002, 10))
    while world.truth_of("ResultsAvailable") != "True":
        bad = [verdict for verdict in world.stored.values() if verdict != "passed"]
        world.look()
        assert world.status.runs.failed == len(bad)
        world.work_all(lambda id_: "failed" if id_ in failed else "passed")
        world.work()
    assert world.status.runs.failed == len(failed) == 1000
    assert world.status.ranges_truncated
    assert len(world.status.model_dump_json()) < 150_000
    world.executed.clear()
    world.ask(attempt=2)
    world.look(dies="before")
    world.look()
    assert (world.status.runs.passed, world.status.runs.failed) == (9002, 0)
    while world.truth_of("ResultsAvailable") != "True":
        world.look(dies="amid")
        world.look()
        world.work_all(lambda id_: "passed")
        world.work()
    assert sorted(world.executed) == sorted(failed)
    assert world.status.runs.passed == 10_002
    assert world.status.failed_runs == ""


def test_the_words_of_the_finish_job_are_asked_for_again_when_its_pod_is_gone() -> None:
    world = World(accepted(runs=1))
    world.mute = {"drive-0123-finish-1"}
    for _ in range(20):
        world.look()
        world.work()
    assert world.created[-2:] == ["drive-0123-finish-1", "drive-0123-finish-1-1"]
    assert world.status.state == "Finished"
    assert "drive-0123-finish-1" not in world.jobs, "one of them is enough"


def test_a_finish_job_whose_pods_vanish_is_made_anew_ever_more_slowly_and_that_is_told() -> None:
    """Whoever dies in between: how many there were stands in the name of the last."""
    world = World(accepted(runs=1))
    world.mute = {f"drive-0123-finish-1{suffix}" for suffix in ("", *(f"-{n}" for n in range(99)))}
    begin = world.now
    again: set[float | None] = set()
    while world.now < begin + timedelta(hours=1):
        again.add(world.look().again)
        world.work()
    finishes = [name for name in world.created if "finish" in name]
    assert 8 <= len(finishes) <= 14
    assert len(world.jobs) <= 4, "of all that were made the last is kept"
    found = next(c for c in world.status.conditions if c.type == "Stalled")
    assert (found.status, found.reason) == ("True", "TaskPodsLost")
    assert "deleted before" in found.message
    assert max(wait for wait in again if wait) > 300, "nobody looks all the while"
    world.mute = set()
    world.now += timedelta(minutes=10)
    world.settle()
    assert world.status.state == "Finished"
    assert world.truth("Stalled") == "False"


def test_a_campaign_that_was_given_up_can_be_repeated() -> None:
    world = World(accepted(runs=20, parallelism=2))
    world.ask(fail_fast=FailFast(max_failed=1))
    for _ in range(3):
        world.look()
        world.work("failed")
    world.settle()
    assert world.status.state == "Failed"
    done = {id_ for id_, verdict in world.stored.items() if verdict == "passed"}
    world.executed.clear()
    world.ask(attempt=2)
    world.settle()
    assert sorted(world.executed) == [id_ for id_ in range(60) if id_ not in done]
    assert world.truth("Succeeded") == world.truth("Passed") == "True"


def test_more_shards_than_a_status_can_tell_of_are_remembered_as_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for module in (picture_module, tell_module):
        monkeypatch.setattr(module, "SHARDS_LIMIT", 5)
    world = World(accepted(runs=1, parallelism=3))
    for runs in range(2, 30):
        world.ask(runs=runs)
        world.look()
        world.work("failed" if runs % 7 == 0 else "passed")
        world.look(dies="before" if runs % 3 else "")
        assert len(world.status.shards) <= 5
    world.settle()
    assert sorted(world.executed) == list(range(87))
    bad = sum(verdict != "passed" for verdict in world.stored.values())
    assert (world.status.runs.failed, world.status.runs.passed) == (bad, 87 - bad)
    world.executed.clear()
    world.ask(attempt=2)
    world.settle()
    assert len(world.executed) == bad
    assert world.truth("Passed") == "True"


def test_a_large_campaign_keeps_a_window_of_shards_open() -> None:
    world = World(accepted(runs=100, parallelism=8))
    first = world.look()
    opened = [a.shard for a in first.actions if isinstance(a, CreateShard)]
    assert len(opened) == shards_module.WINDOW
    assert sum(shard.parallelism for shard in opened) == 8
    world.look()
    assert len(world.jobs) == shards_module.WINDOW
    while not any(job.over for job in world.jobs.values()):
        world.work()
    world.look()
    assert len(world.jobs) == shards_module.WINDOW + 1


def test_a_name_that_others_have_taken_holds_no_other_shard() -> None:
    world = World(accepted(runs=100, parallelism=8))
    names = [shard.job for shard in world.snapshot().shards]
    world.taken = frozenset(names[:1])
    for _ in range(1000):
        world.look()
        if not world.work() and set(world.created) >= set(names[1:]):
            break
    assert names[0] not in world.created
    assert world.status.state != "Finished"
    world.taken = frozenset()
    while world.status.state != "Finished":
        world.look()
        world.work()
    assert len(world.executed) == len(world.stored)


def test_jobs_whose_verdicts_are_in_the_status_go_but_for_the_last_few() -> None:
    world = World(accepted(runs=100, parallelism=8))
    most = 0
    while world.status.state != "Finished":
        world.look()
        if not world.work("failed" if len(world.executed) % 7 == 3 else "passed"):
            world.look()
        most = max(most, sum(job.role == "shard" for job in world.jobs.values()))
    assert len(world.status.shards) > 10
    assert most <= 2 * shards_module.WINDOW + 2
    left = [name for name, job in world.jobs.items() if job.role == "shard" and not job.deleting]
    assert left == [shard.job for shard in world.status.shards[-shards_module.WINDOW :]]
    assert world.status.runs.failed == sum(found == "failed" for found in world.stored.values())


def test_the_last_jobs_share_all_pods() -> None:
    world = World(accepted(runs=5, parallelism=8))
    world.look()
    jobs = list(world.jobs.values())
    assert [(job.size, job.parallelism) for job in jobs] == [(3, 2), (4, 2), (4, 2), (4, 2)]
    for _ in range(3 + 4 + 1):
        world.work()
    world.look()
    assert [job.parallelism for job in jobs[2:]] == [3, 4]
    assert world.pods <= 8


def test_the_index_is_made_when_the_last_pod_is_gone() -> None:
    """A pod that is told to end stores what it has first."""
    world = World(accepted(runs=20, parallelism=4))
    world.ask(fail_fast=FailFast(max_failed=0))
    world.look()
    world.work("failed")
    world.look()
    assert any(job.deleting for job in world.jobs.values())
    assert not any("finish" in name for name in world.created)
    assert not any("finish" in a.name for a in world.look().actions if isinstance(a, CreateTask))
    world.look()
    assert any("finish" in name for name in world.created)


def test_a_campaign_of_a_hundred_thousand_runs_stays_small() -> None:
    world = World(accepted(runs=33_334, parallelism=400))
    for _ in range(3):
        world.look()
    assert len(world.status.model_dump_json()) < 20_000


def test_after_the_end_nothing_is_done_any_more() -> None:
    world = World(accepted(runs=3))
    world.settle()
    decision = world.look()
    assert (decision.actions, decision.later, decision.again) == ((), (), None)
    assert decision.status == world.status


def test_results_are_worked_up_after_the_index_when_that_is_asked_for() -> None:
    world = World(accepted(runs=1, processResults=True))
    world.settle()
    assert world.created == ["drive-0123-0", "drive-0123-finish-1", "drive-0123-process-1"]
    assert world.truth("ResultsAvailable") == "True"
    world.jobs.clear()
    world.look()
    assert len(world.created) == 3


def test_results_are_uploaded_once_whenever_they_are_complete() -> None:
    world = World(accepted(runs=1, share={"secretName": "robovast-share"}))
    world.settle(verdict="failed")
    assert world.uploads == ["drive-0123-share-1-1"]
    world.jobs.clear()  # they have expired
    world.look()
    assert len(world.uploads) == 1
    world.ask(attempt=2)
    world.settle()
    assert world.uploads[1:] == ["drive-0123-share-2-2"]
    world.status = world.status.model_copy(update={"shared": ""})
    world.look(dies="before")
    world.look()
    assert world.uploads[2:] == ["drive-0123-share-2-2"] * 2
    without = World(accepted(runs=1))
    without.settle()
    assert (without.uploads, without.status.shared) == ([], "")
    without.ask(share=ShareTarget(secret_name="robovast-share"))
    without.look()
    assert without.uploads == ["drive-0123-share-1-1"]


def test_a_job_that_holds_pods_which_are_to_go_is_made_anew() -> None:
    world = World(accepted(runs=2))
    world.look()
    stuck = PodFindings(stuck=frozenset({"drive-0123-0"}))
    held = replace(world.snapshot(), pods=stuck)
    assert decide(held).actions == (DeleteJob("drive-0123-0"),)
    world.jobs["drive-0123-0"].deleting = True
    held = replace(world.snapshot(), pods=stuck)
    assert decide(held).actions == (), "once is enough"


def test_a_job_goes_with_its_configuration_though_its_shard_was_settled_long_ago() -> None:
    world = World(accepted(runs=2))
    (revision,) = world.revisions
    owner = {"uid": "of-a-configuration", "name": "more"}
    world.revisions = [replace(revision, owners={0: owner})]
    world.settle()
    jobs = [name for name, job in world.jobs.items() if job.role == "shard"]
    assert world.look().later == ()
    world.withdrawn = frozenset({owner["uid"]})
    assert world.look().later == tuple(DeleteJob(name) for name in jobs)


def test_a_campaign_ends_without_the_runs_of_a_configuration_that_is_gone() -> None:
    """Its Job goes with it, and is not made again; what has no verdict is errored."""
    world = World(accepted(runs=2, parallelism=1))
    (revision,) = world.revisions
    owner = {"uid": "of-a-configuration", "name": "more"}
    world.revisions = [replace(revision, owners={0: owner})]
    world.look()
    world.work()
    world.withdrawn = frozenset({owner["uid"]})
    before = list(world.created)
    assert world.look().later == (DeleteJob("drive-0123-0"),)
    world.look()
    assert world.created[len(before) :] == [name for name in world.created if "finish" in name]
    world.settle()
    assert world.status.state == "Finished"
    assert world.status.progress == "6/6"
    assert world.status.runs.errored == 5


def test_pods_that_are_not_at_work_are_told_to_wait() -> None:
    world = World(accepted(runs=1, parallelism=12))
    world.look()
    world.look()
    (job,) = world.jobs.values()
    job.ready = 0
    world.look()
    assert (world.status.runs.active, world.status.runs.waiting) == (0, 3)
    assert world.status.state == "Pending"
    job.ready = 2
    world.look()
    assert (world.status.runs.active, world.status.runs.waiting) == (2, 1)
    assert world.status.state == "Running"


def test_a_campaign_none_of_whose_pods_is_at_work_is_said_to_stall_with_the_cause() -> None:
    world = World(accepted(runs=1, parallelism=12))
    world.look()
    world.look()
    (job,) = world.jobs.values()
    job.ready = 0
    stalled = replace(
        world.snapshot(), pods=PodFindings(trouble=Trouble("ImagePullFailed", "no image"))
    )
    assert decide(stalled).status.state == "Stalled"
    job.ready = 1
    dying = replace(
        world.snapshot(), pods=PodFindings(trouble=Trouble("Evicted", "again", deadly=True))
    )
    assert decide(dying).status.state == "Running"
