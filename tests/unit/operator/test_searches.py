"""Searches in a cluster: whatever dies, and whatever a propose Job says."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from support.kube.fake_cluster import SCENARIO, SEARCH, SETTINGS, World, accepted, campaign

from robovast.kubeapi.pod_contract.messages import BLOCKS_LIMIT, Proposed
from robovast.model.packs import Block, PlanSpec
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Rejected
from robovast_operator.planning.configurations import own_configurations
from robovast_operator.planning.proposals import first_plan, grown

DIGEST = "ab" * 32


def batch(*blocks: tuple[int, int, int, int], variants: int = 0, **more: Any) -> Proposed:
    return Proposed(blocks=blocks, variants=variants, digest=DIGEST, **more)


def three_batches() -> list[Proposed]:
    """Two sets; two more, and one of the first again; the end."""
    return [
        batch((0, 2, 0, 3), variants=2),
        batch((2, 2, 0, 3), (1, 1, 3, 2), variants=2, batch=1, evaluated=2, best="x 1"),
        batch(batch=2, evaluated=4, best="x 2", stop="batches", stop_reason="batches 2/2"),
    ]


def searching(**spec: Any) -> World:
    world = World(accepted(SEARCH, **spec))
    world.begin(*three_batches())
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


moments = st.lists(
    st.tuples(
        st.sampled_from(["look", "dies before", "dies amid", "work", "vanish", "mute"]),
        st.integers(0, 5),
        st.sampled_from(["passed", "failed", "errored"]),
    ),
    max_size=60,
)


@settings(max_examples=60, deadline=None)
@given(moments)
def test_no_order_of_events_changes_what_a_search_runs(
    events: list[tuple[str, int, str]],
) -> None:
    world = searching(parallelism=3)
    for kind, which, verdict in events:
        jobs = [n for n, job in world.jobs.items() if job.role == "propose" or not job.over]
        match kind:
            case "look":
                world.look()
            case "dies before" | "dies amid":
                world.look(dies=kind.split()[1])
            case "work":
                world.work(verdict, which)
            case "vanish" if jobs:  # somebody deletes a Job
                del world.jobs[jobs[which % len(jobs)]]
            case "mute" if jobs:  # somebody deletes its pods
                world.mute.add(jobs[which % len(jobs)])
    for _ in range(12):  # words that are lost are asked for again, after pauses
        world.settle()
        world.now += timedelta(minutes=11)
    assert sorted(world.executed) == list(range(14))
    assert [revision.plan.total for revision in world.revisions] == [6, 14]
    assert world.status.state == "Finished"
    assert world.status.search is not None
    assert (world.status.search.batch, world.status.search.stop) == (2, "batches")
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
        (batch((0, 1, 0, 1), variants=1), "are not those that come next"),
        (batch((2, 1, 1, 1), variants=1), "are not those that come next"),
        (batch((1, 2, 0, 3), variants=1), "are not those that come next"),
        (batch((2, 2, 0, 1), variants=1), "configuration 3 of 3"),
        (batch((2, 1, 0, 20_000_000), variants=1), "more than 10,000,000 runs"),
        (batch((2, 0, 0, 1), variants=1), "greater than 0"),
        (batch((2, 1, 0, 1), variants=999), "more than 1,000"),
        (batch(variants=1), "asks for no runs"),
        (batch((2, 1, 0, 1), variants=1, breaks="7-x"), "7-x"),
        (Proposed(blocks=((2, 1, 0, 1),), variants=1), "names no list"),
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
    with pytest.raises(ValueError, match="12,001 blocks of runs it is too large for a ConfigMap"):
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
    assert told == Rejected("InvalidDocument", "line 3: no such marker")


def test_a_selection_has_no_meaning_in_a_search() -> None:
    obj = campaign(select=["one-*"])
    del obj["spec"]["vast"]["configuration"]
    obj["spec"]["vast"]["search"] = SEARCH
    refused = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(refused, Rejected)
    assert "spec.select" in refused.message
