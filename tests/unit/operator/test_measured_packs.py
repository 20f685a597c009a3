"""Packs that are planned while a campaign runs (`runs_per_job: auto`)."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import World, accepted

from robovast.kubeapi.resources import FailFast
from robovast.model.packing import Pace, PackSample
from robovast.model.packs import Entry
from robovast_operator.decide import AppendRuns, ResizeJob
from robovast_operator.planning.measured_packs import next_round
from robovast_operator.planning.revisions import Addition, next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.reports import sample_of

AUTO = {"runs_per_job": "auto"}

events = st.lists(
    st.tuples(
        st.sampled_from(["look", "dies before", "dies amid", "work", "work", "work"]),
        st.integers(0, 9),
        st.sampled_from(["passed", "passed", "failed", "errored"]),
    ),
    max_size=120,
)
PACE = Pace(start=10, run=1)
paces = st.none() | st.builds(Pace, st.floats(0, 60), st.floats(0.01, 60))


def world(runs: int, pace: Pace | None = PACE, **spec: Any) -> World:
    made = World(accepted(execution=AUTO, runs=runs, **spec))
    made.pace = pace
    return made


def at_work(made: World) -> int:
    return sum(job.state().active for job in made.jobs.values() if job.role == "shard")


@settings(max_examples=25, deadline=None)
@given(events, st.integers(1, 60), st.integers(1, 9), paces)
def test_every_run_is_executed_once_whatever_dies(
    moments: list[tuple[str, int, str]], runs: int, parallelism: int, pace: Pace | None
) -> None:
    made = world(runs, pace, parallelism=parallelism)
    for kind, which, verdict in moments:
        made.meet(kind, which, verdict)
        assert at_work(made) <= parallelism
    made.settle(looks=2000)
    assert sorted(made.executed) == list(range(3 * runs))
    assert made.status.runs.total == 3 * runs
    assert made.status.runs.decided == 3 * runs
    assert made.status.state == "Finished"


def test_packs_grow_with_what_is_measured_and_shrink_at_the_end() -> None:
    made = world(1000, parallelism=10)
    made.settle(looks=9000)
    plan = made.revisions[-1].plan
    sizes = [round_.size for round_ in plan.rounds or ()]
    assert sizes[:2] == [1, 16]
    assert max(sizes) > 100
    assert sizes[-1] <= 80, "eight starts"
    assert len(sizes) < 15
    assert len(made.executed) == len(set(made.executed)) == 3000


def test_nothing_is_planned_before_half_of_the_first_packs_have_ended() -> None:
    made = world(100, parallelism=10)
    made.look()
    made.look()
    for _ in range(4):
        assert made.work()
        made.look()
    assert len(made.revisions) == 2
    made.work()
    made.look()
    assert len(made.revisions) == 3


def test_nothing_measured_means_packs_as_before_and_no_standstill() -> None:
    made = world(10, pace=None, parallelism=4)
    made.settle()
    assert {round_.size for round_ in made.revisions[-1].plan.rounds or ()} == {1}
    assert len(made.executed) == 30


def test_pods_that_are_left_over_are_asked_for_in_few_steps() -> None:
    made = world(2000, parallelism=100)
    changes = 0
    while made.status.state != "Finished":
        decision = made.look()
        changes += sum(isinstance(act, ResizeJob | AppendRuns) for act in decision.actions)
        made.work()
    assert len(made.executed) == 6000
    assert changes <= 10 * len(made.revisions)


def test_what_was_in_no_pack_is_repeated_after_a_campaign_was_given_up() -> None:
    made = world(50, parallelism=4)
    made.ask(fail_fast=FailFast(max_failed=0))
    made.look()
    made.look()
    made.work("failed")
    made.settle()
    assert made.status.state == "Failed"
    assert len(made.executed) < 10
    done = {id_ for id_, verdict in made.stored.items() if verdict == "passed"}
    made.executed.clear()
    made.ask(attempt=2, fail_fast=FailFast())
    made.settle()
    assert sorted(made.executed) == sorted(set(range(150)) - done)
    assert made.status.runs.passed == 150


def test_further_runs_are_packed_too() -> None:
    made = world(5, parallelism=4)
    made.settle()
    made.ask(runs=40)
    made.settle()
    assert sorted(made.executed) == list(range(120))
    assert made.status.state == "Finished"


def test_a_job_has_runs_of_one_configuration_object_only() -> None:
    made = world(2, parallelism=50)
    owner = {"name": "more", "uid": "9"}
    added = Addition(Entry(name="more", variants=2), 5, owner, {"name": "more"})
    new = next_revision(made.accepted, made.revisions, [added], "plan-1")
    assert new is not None
    revisions = [*made.revisions, new]
    while revisions[-1].plan.in_packs < revisions[-1].plan.total:
        name = f"plan-{len(revisions)}"
        revisions.append(next_round(revisions[-1], 50, Pace(1, 100), name))
    shards = first_attempts(made.accepted.identity, revisions)
    assert [(shard.configuration, shard.size) for shard in shards] == [("", 6), ("more", 10)]


def test_runs_as_needed_share_a_pod_by_their_configuration_as_ever() -> None:
    rule = {"min": 2, "max": 6, "decide": {"good": 0.1, "bad": 0.6, "error": 0.1}}
    made = World(accepted(as_needed=rule, execution=AUTO))
    plan = made.revisions[0].plan
    assert (plan.rounds, plan.packs, plan.runs_per_start) == (None, 3, 6)


def ended_pod(message: str, **status: Any) -> dict[str, Any]:
    end = {"exitCode": 0, "message": message, "finishedAt": "2026-01-01T00:00:30Z"}
    agent = {"name": "agent", "state": {"terminated": end}}
    began = {"startTime": "2026-01-01T00:00:00Z"}
    return {"metadata": {}, "spec": {}, "status": {**began, "containerStatuses": [agent], **status}}


def test_a_pod_says_how_long_its_runs_took_and_kubernetes_how_long_all_of_it() -> None:
    said = '{"passed": "0-3", "failed": "", "errored": "", "executed": 4, "seconds": 20.5}'
    assert sample_of(ended_pod(said)) == PackSample(4, 20.5, 30.0)


@pytest.mark.parametrize(
    "pod",
    [
        ended_pod('{"passed": "0-3", "failed": "", "errored": ""}'),
        ended_pod('{"passed": "0", "failed": "", "errored": "", "executed": 1, "seconds": -1}'),
        ended_pod('{"passed": "0", "failed": "", "errored": "", "executed": 1, "seconds": NaN}'),
        ended_pod("what?"),
        ended_pod('{"passed": "0", "failed": "", "errored": ""}', containerStatuses=[]),
    ],
)
def test_what_a_pod_does_not_say_is_not_measured(pod: dict[str, Any]) -> None:
    assert sample_of(pod) is None
