from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.analysis.postprocessing.commands import PostprocessingCommand
from robovast.analysis.postprocessing.plan import all_done, plan, taken_back
from robovast.analysis.postprocessing.state import Unit
from robovast.analysis.postprocessing.survey import OWN, WHOLE

BAG = PostprocessingCommand("rosbags_tf_to_csv", {}, Path(), "bag")
EACH = PostprocessingCommand("t.py:each", {}, Path(), "each")
ALL = PostprocessingCommand("t.py:all", {}, Path(), "all")
LAST = PostprocessingCommand("t.py:last", {}, Path(), "last")
PER_RUN = {"bag", "each"}


def units(whole: set[str] = frozenset(), **runs: set[str]) -> dict[str, Unit]:  # type: ignore[assignment]
    found = {path: Unit(path, done=frozenset(done)) for path, done in runs.items()}
    return {OWN: Unit(OWN), **found, WHOLE: Unit(WHOLE, done=frozenset(whole))}


def called(steps: list) -> list:
    return [
        [c.key for c in step.commands]
        if step.runs is None
        else {path: [c.key for c in calls] for path, calls in step.runs.items()}
        for step in steps
    ]


def test_what_is_done_is_not_planned() -> None:
    known = units({"all"}, a={"bag", "each"}, b={"bag", "each"})
    assert all_done([BAG, EACH, ALL], known)
    assert plan([BAG, EACH, ALL], PER_RUN, known) == []


def test_only_runs_that_lack_something_are_worked() -> None:
    known = units(a={"bag"}, b=set())
    assert called(plan([BAG], PER_RUN, known)) == [{"b": ["bag"]}]


def test_a_command_follows_those_that_it_may_read_from() -> None:
    known = units({"all", "last"}, a={"each"}, b={"bag", "each"})
    steps = plan([BAG, EACH, ALL, LAST], PER_RUN, known)
    assert called(steps) == [{"a": ["bag", "each"]}, ["all"], ["last"]]


def test_a_command_for_the_campaign_renews_those_of_all_runs_behind_it() -> None:
    known = units(set(), a={"bag", "each"})
    assert called(plan([BAG, ALL, EACH], PER_RUN, known)) == [["all"], {"a": ["each"]}]


def test_bags_need_nothing_of_others() -> None:
    other = PostprocessingCommand("rosbags_bt_to_csv", {}, Path(), "other")
    known = units(a={"other"})
    assert called(plan([BAG, other], {"bag", "other"}, known)) == [{"a": ["bag"]}]


@given(
    st.sets(st.sampled_from(["all", "last"])),
    st.lists(st.sets(st.sampled_from(["bag", "each"])), min_size=1, max_size=4),
)
def test_nothing_is_claimed_that_is_about_to_be_done(whole: set[str], runs: list[set[str]]) -> None:
    known = units(whole, **{f"r{index}": done for index, done in enumerate(runs)})
    steps = plan([BAG, EACH, ALL, LAST], PER_RUN, known)
    after = {**known, **taken_back(steps, known)}
    for step in steps:
        for path, commands in (step.runs or {WHOLE: step.commands}).items():
            assert after[path].done.isdisjoint(c.key for c in commands)
    assert bool(steps) != all_done([BAG, EACH, ALL, LAST], known)


@pytest.mark.parametrize("runs", [{}, {"a": {"bag"}}])
def test_without_commands_all_is_done(runs: dict[str, set[str]]) -> None:
    assert all_done([], units(**runs))
