"""Searches in a cluster: whatever dies, and whatever a propose Job says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from support.kube.fake_cluster import SCENARIO, SEARCH, SETTINGS, FakeJob, World, accepted, campaign

from robovast.base.serialization import dump_yaml
from robovast.kubeapi.pod_contract.messages import BLOCKS_LIMIT, Proposed
from robovast.model.packs import Block, PlanSpec
from robovast_operator.planning.accept import accept, same_document
from robovast_operator.planning.campaign import Rejected
from robovast_operator.planning.configurations import own_configurations
from robovast_operator.planning.proposals import first_plan, grown

DIGEST = "ab" * 32
BATCHES = 500
"""Of a long search."""


def batch(*blocks: tuple[int, int, int, int], variants: int = 0, **more: Any) -> Proposed:
    return Proposed(blocks=blocks, variants=variants, digest=DIGEST, **more)


def three_batches() -> list[Proposed]:
    """Two sets; two more, and one of the first again; the end."""
    return [
        batch((0, 2, 0, 3), variants=2),
        batch((2, 2, 0, 3), (1, 1, 3, 2), variants=2, batch=1, evaluated=2, best="x 1"),
        batch(batch=2, evaluated=4, best="x 2", stop="batches", stop_reason="batches 2/2"),
    ]


def asked_ahead() -> list[Proposed]:
    """One batch; two, of which the next words need the first; one more; its wait; the end."""
    return [
        batch((0, 2, 0, 3), variants=2),
        batch((2, 2, 0, 3), (4, 2, 0, 3), variants=4, batch=1, evaluated=2, awaited=2),
        batch((6, 1, 0, 3), variants=1, batch=2, evaluated=4, awaited=3),
        batch(batch=3, evaluated=6, awaited=4),
        batch(batch=4, evaluated=7, stop="batches", stop_reason="batches 4/4"),
    ]


def searching(said: Sequence[Proposed] = (), **spec: Any) -> World:
    world = World(accepted(SEARCH, **spec))
    world.begin(*(said or three_batches()))
    return world


def test_a_search_runs_what_is_proposed_batch_by_batch_and_ends() -> None:
    world = searching()
    world.look()
    world.work_all(lambda id_: "failed" if id_ else "passed")
    world.look()
    assert world.status.state == "Proposing"
    assert world.truth("ResultsAvailable") == "False"
    world.settle("failed")
    assert [name.partition("0123-")[2] for name in world.created] == [
        *("0", "propose-1", "1", "2", "propose-2", "finish-3")
    ]
    assert sorted(world.executed) == list(range(6 + 8))
    search = world.status.search
    assert search is not None
    assert (search.batch, search.evaluated, search.best, search.stop) == (2, 4, "x 2", "batches")
    assert world.status.state == "Finished"
    assert world.truth("Passed") == "True", "failed runs are what a search looks for"
    assert len(world.status.model_dump_json()) < 4000
    assert own_configurations(world.accepted) == []


def two_batches_at_work() -> tuple[World, FakeJob, FakeJob]:
    """A search of which batch 1 and 2 are executed, and their Jobs."""
    world = searching(asked_ahead(), parallelism=30)
    world.look()
    world.work_all(lambda _: "passed")
    world.look()
    world.work()  # of the propose Job
    for _ in range(3):
        world.look()
    one, two = (world.jobs[world.accepted.identity.child(number)] for number in (1, 2))
    return world, one, two


def end(job: FakeJob) -> None:
    job.done = dict.fromkeys(range(job.size), "passed")


def test_the_next_batch_is_asked_for_while_another_one_is_executed() -> None:
    world, one, two = two_batches_at_work()
    end(one)
    world.look()
    assert world.created[-1].endswith("propose-2")
    assert (world.status.state, world.truth("Reconciling")) == ("Running", "True")
    end(world.jobs[world.created[-1]])
    world.look()
    world.look()
    assert world.created[-1].endswith("0123-3"), "its runs begin beside those of batch 2"
    assert not two.over
    world.settle()
    assert world.status.state == "Finished"
    assert world.status.search is not None
    assert (world.status.search.batch, world.status.search.stop) == (4, "batches")


def test_after_many_batches_plans_and_status_are_small() -> None:
    """Of the plans, the first one and the last few are left; what the others said is in them."""
    said = [batch((n, 1, 0, 1), variants=1, batch=n, evaluated=n) for n in range(BATCHES)]
    end_ = batch(batch=BATCHES, evaluated=BATCHES, stop="batches", stop_reason="end")
    world = searching([*said, end_])
    world.settle(looks=20 * BATCHES)
    assert sorted(world.executed) == list(range(BATCHES))
    last = range(BATCHES - 4, BATCHES)
    assert [revision.number for revision in world.revisions] == [0, *last]
    assert len(world.jobs) < 12
    assert world.revisions[-1].plan.total == BATCHES
    assert len(world.status.model_dump_json(by_alias=True, exclude_none=True)) < 250 * BATCHES


def test_a_plan_stays_while_pods_of_it_may_begin() -> None:
    """Batch 2 takes as long as many that follow it: the world refuses that its plan goes."""
    begun = [batch((0, 1, 0, 2), variants=1), batch((1, 1, 0, 2), variants=1, batch=1, awaited=1)]
    rest = [batch((n, 1, 0, 2), variants=1, batch=n, awaited=1) for n in range(2, 12)]
    world = searching([*begun, *rest], parallelism=30)
    for _ in range(60):
        if world.revisions[-1].number == 9:
            break
        world.look()
        for job in world.jobs.values():
            if job.role == "propose" or job.name == world.accepted.identity.child(0):
                end(job)
    world.look()
    assert [revision.number for revision in world.revisions] == list(range(10))
    for job in world.jobs.values():
        if job.name != world.accepted.identity.child(3):
            end(job)
    world.look()
    world.look()
    assert [r.number for r in world.revisions] == [0, 3, 7, 8, 9, 10]


def test_what_is_asked_for_does_not_depend_on_which_batch_is_faster() -> None:
    world, one, two = two_batches_at_work()
    end(two)
    world.look()
    assert not any("propose-2" in name for name in world.created), "it is made from batch 1"
    end(one)
    world.look()
    assert world.created[-1].endswith("propose-2")


def ends_after(world: World, batches: int) -> None:
    """Somebody patches the budget."""
    world.accepted = accepted({**SEARCH, "budget": [{"batches": batches}]})
    world.plan_more()


def test_a_search_that_has_ended_goes_on_with_more_budget() -> None:
    world = searching()
    world.settle()
    assert world.truth("ResultsAvailable") == "True"
    ends_after(world, 4)
    assert yaml.safe_load(world.revisions[-1].document)["search"]["budget"] == [{"batches": 4}]
    assert world.revisions[-1].plan == world.revisions[-2].plan
    again = batch((4, 1, 0, 3), variants=1, batch=2, evaluated=4)
    world.batches += [again, batch(batch=3, evaluated=5, stop="batches", stop_reason="3/3")]
    world.look(dies="before")
    world.jobs.clear()  # whatever remembers how it ended but for the status
    world.look()
    assert world.created[-1].endswith("propose-3")
    assert world.status.state == "Proposing"
    assert world.truth("ResultsAvailable") == "False"
    assert world.status.search is not None
    assert (world.status.search.batch, world.status.search.stop) == (2, "")
    world.settle()
    assert sorted(world.executed) == list(range(17))
    assert world.status.state == "Finished"
    assert (world.status.search.batch, world.status.search.stop) == (3, "batches")


def test_a_budget_that_is_raised_while_runs_or_words_are_awaited_counts_for_what_follows() -> None:
    world, one, two = two_batches_at_work()
    ends_after(world, 9)
    world.batches.insert(2, batch(stop="batches", stop_reason="of the old budget"))
    end(one)
    world.look()
    assert world.created[-1].endswith("propose-3"), "it reads the plan with the new budget"
    assert not two.over
    ends_after(world, 10)
    world.batches.insert(3, batch(stop="batches", stop_reason="of the old budget"))
    end(world.jobs[world.created[-1]])
    world.look()
    assert world.created[-1].endswith("propose-4")
    world.settle()
    assert world.revisions[-1].plan.total == 21
    assert world.status.state == "Finished"


def test_nothing_but_the_end_of_a_search_may_change() -> None:
    text = dump_yaml(accepted(SEARCH).spec.vast)
    for change, same in (
        ({"budget": [{"batches": 9}]}, True),
        ({"stopping": [{"target_objective": 1.0}]}, True),
        ({"per_batch": 9}, False),
        ({"strategy": "boundary"}, False),
    ):
        assert same_document(text, accepted({**SEARCH, **change}).spec.vast) is same
    world = searching()
    world.accepted = accepted({**SEARCH, "per_batch": 9})
    world.plan_more()
    assert len(world.revisions) == 1, "it is refused, not planned"


moments = st.lists(
    st.tuples(
        st.sampled_from(["look", "dies before", "dies amid", "work", "vanish", "mute"]),
        st.integers(0, 5),
        st.sampled_from(["passed", "failed", "errored"]),
    ),
    max_size=60,
)


@settings(max_examples=60, deadline=None)
@given(moments, st.booleans())
def test_no_order_of_events_changes_what_a_search_runs(
    events: list[tuple[str, int, str]], ahead: bool
) -> None:
    said = asked_ahead() if ahead else three_batches()
    world = searching(said, parallelism=3)
    for kind, which, verdict in events:
        jobs = [n for n, job in world.jobs.items() if job.role == "propose" or not job.over]
        world.meet(kind, which, verdict)
        match kind:
            case "vanish" if jobs:  # somebody deletes a Job
                del world.jobs[jobs[which % len(jobs)]]
            case "mute" if jobs:  # somebody deletes its pods
                world.mute.add(jobs[which % len(jobs)])
    for _ in range(12):  # words that are lost are asked for again, after pauses
        world.settle()
        world.now += timedelta(minutes=11)
    totals = [6, 18, 21, 21] if ahead else [6, 14]
    assert sorted(world.executed) == list(range(totals[-1]))
    assert world.totals == totals
    assert world.status.state == "Finished"
    assert world.status.search is not None
    assert (world.status.search.batch, world.status.search.stop) == (said[-1].batch, "batches")
    assert sum(job.role == "propose" for job in world.jobs.values()) <= 1


def test_a_suspended_search_proposes_nothing_and_goes_on_where_it_was() -> None:
    world = searching()
    world.look()
    world.work_all(lambda _: "passed")
    world.ask(suspend=True)
    world.settle()
    assert not any("propose" in name for name in world.created)
    assert world.status.state == "Suspended"
    world.ask(suspend=False)
    world.settle()
    assert sorted(world.executed) == list(range(14))


def test_raised_runs_are_left_to_the_next_batches() -> None:
    world = searching()
    world.ask(runs=9)
    assert len(world.revisions) == 1


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (batch((0, 1, 0, 1), variants=1), "are not the next runs"),
        (batch((2, 1, 1, 1), variants=1), "are not the next runs"),
        (batch((1, 2, 0, 3), variants=1), "are not the next runs"),
        (batch((2, 2, 0, 1), variants=1), "configuration 3 of 3"),
        (batch((2, 1, 0, 20_000_000), variants=1), "more than 10,000,000 runs"),
        (batch((2, 0, 0, 1), variants=1), "greater than 0"),
        (batch((2, 1, 0, 1), variants=999), "more than 1,000"),
        (batch(variants=1), "no runs are requested"),
        (batch(awaited=1), "no runs are requested"),
        (
            batch((2, 1, 0, 3), variants=1, awaited=3),
            "3 awaited blocks of runs are not between 1 and 2",
        ),
        (batch((2, 1, 0, 3), variants=1, awaited=0), "0 awaited blocks of runs"),
        (batch((2, 1, 0, 1), variants=1, breaks="7-x"), "7-x"),
        (Proposed(blocks=((2, 1, 0, 1),), variants=1), "has no digest"),
    ],
)
def test_words_that_make_no_plan_end_the_search_and_say_why(said: Proposed, why: str) -> None:
    made = accepted(SEARCH)
    first = first_plan(made, three_batches()[0], "plan-0", 1000, "")
    assert not isinstance(first, Rejected)
    with pytest.raises(ValueError, match=why):
        grown(made, [first], said, "plan-1", 1000)
    world = searching()
    world.batches[1] = said
    world.variant_limit = 1000
    world.settle()
    assert world.status.state == "Failed"
    found = {c.type: c for c in world.status.conditions}
    assert found["Succeeded"].reason == "InvalidPlan"
    assert why in found["Succeeded"].message
    assert found["ResultsAvailable"].status == "True", "what was stored is indexed"


def test_a_plan_that_no_config_map_has_room_for_ends_the_search() -> None:
    made = accepted(SEARCH)
    first = first_plan(made, batch((0, 2, 0, 3), variants=2), "plan-0", 1000, "")
    assert not isinstance(first, Rejected)
    many = tuple(Block(first_variant=i % 2, variants=1, first_run=i, runs=1) for i in range(12_000))
    long = replace(first, plan=first.plan.model_copy(update={"blocks": many}))
    said = batch((2, 1, 0, 3), variants=1)
    assert grown(made, [replace(first, plan=PlanSpec(blocks=many[:8_000]))], said, "", 1000)
    with pytest.raises(ValueError, match="12,001 blocks of runs are too large for a ConfigMap"):
        grown(made, [long], said, "plan-1", 1000)


def test_a_message_is_bounded() -> None:
    for wrong in (
        {"blocks": [[0, 1, 0, 1]] * (BLOCKS_LIMIT + 1)},
        {"blocks": [], "variants": 10_001},
        {"blocks": [], "best": "x" * 251},
        {"blocks": [], "digest": "nothing"},
        {"blocks": [[0, 1, 0]]},
        {"blocks": [[-1, 1, 0, 1]]},
    ):
        with pytest.raises(ValidationError):
            Proposed.model_validate(wrong)


def test_a_search_without_any_score_does_not_pass() -> None:
    world = World(accepted(SEARCH))
    ended = batch(batch=1, stop="batches", stop_reason="batches 1/1")
    world.begin(three_batches()[0], ended)
    world.settle("errored")
    assert world.truth("Passed") == "False"
    assert world.truth("Succeeded") == "True"


def test_a_search_that_begins_with_its_end_is_refused() -> None:
    said = batch(stop="exhausted", stop_reason="nothing is left")
    refused = first_plan(accepted(SEARCH), said, "plan-0", 10, "")
    assert isinstance(refused, Rejected)
    assert "nothing is left" in refused.message
    told = first_plan(accepted(SEARCH), "line 3: no such marker", "plan-0", 10, "InvalidDocument")
    assert isinstance(told, Rejected)
    assert told.reason == "InvalidDocument"
    assert told.message.startswith("The .vast file is invalid: line 3: no such marker. Fix")


def test_a_selection_has_no_meaning_in_a_search() -> None:
    obj = campaign(select=["one-*"])
    del obj["spec"]["vast"]["configuration"]
    obj["spec"]["vast"]["search"] = SEARCH
    refused = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(refused, Rejected)
    assert "spec.select" in refused.message
