"""The sequential test stops early, and is wrong no more often than it says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.sequential import Decision, SequentialTest, State

USUAL = SequentialTest(good=0.05, bad=0.2, error=0.05, least=3, most=50)


def test_it_stops_as_soon_as_one_rate_is_twenty_times_as_likely() -> None:
    assert USUAL.decide([True] * 50) == Decision(State.BROKEN, 3, 0)
    assert USUAL.decide([False] * 50) == Decision(State.SOUND, 18, 0)
    assert USUAL.decide([False] * 17).state is State.UNDECIDED
    assert (USUAL.shortest(outcome=True), USUAL.shortest(outcome=False)) == (3, 18)


def test_it_gives_up_after_the_most_runs() -> None:
    between = ([True] + 7 * [False]) * 10
    assert USUAL.decide(between) == Decision(State.UNDECIDED, 50, 0)


def test_it_decides_nothing_before_the_least_runs() -> None:
    late = SequentialTest(0.05, 0.2, 0.05, least=10, most=50)
    assert late.decide([True] * 9) == Decision(State.UNDECIDED, 9, 1)
    assert late.decide([True] * 50) == Decision(State.BROKEN, 10, 0)


def test_what_is_no_evidence_counts_as_a_run_alone() -> None:
    assert USUAL.decide([None, True, None, True, True]) == Decision(State.BROKEN, 5, 0)
    assert USUAL.decide([None] * 60) == Decision(State.UNDECIDED, 50, 0)


@pytest.mark.parametrize(
    "rates", [(1e-310, 0.5), (1e-300, 2e-300), (0.1, 0.10000000000000002), (0.01, 1 - 1e-16)]
)
def test_rates_that_no_run_tells_apart_are_never_told_apart(rates: tuple[float, float]) -> None:
    good, bad = rates
    for error in (0.4999, 1e-310):
        test = SequentialTest(good, bad, error, least=1, most=30)
        assert test.decide([False] * 30).runs <= 30
        assert test.decide([True] * 30).runs <= 30


@given(st.lists(st.sampled_from([True, False, None]), max_size=60))
def test_the_runs_that_it_needs_follow_from_those_before(outcomes: list[bool | None]) -> None:
    end = USUAL.decide(outcomes)
    for known in range(min(len(outcomes), end.runs)):
        early = USUAL.decide(outcomes[:known])
        assert not early.is_over
        assert known + early.further <= end.runs + end.further
    assert USUAL.decide(outcomes[: end.runs]) == end


@pytest.mark.parametrize("test", [USUAL, replace(USUAL, most=15), replace(USUAL, most=600)])
@pytest.mark.parametrize(
    ("rate", "wrong"),
    [(0.05, State.BROKEN), (0.02, State.BROKEN), (0.2, State.SOUND), (0.5, State.SOUND)],
)
def test_a_wrong_decision_is_no_more_likely_than_stated(
    test: SequentialTest, rate: float, wrong: State
) -> None:
    assert _probability(test, rate, wrong) <= 0.05


@given(st.floats(0.01, 0.4), st.floats(0.02, 0.5), st.floats(0.01, 0.4), st.integers(1, 14))
def test_a_wrong_decision_is_no_more_likely_than_stated_for_any_test(
    good: float, gap: float, error: float, least: int
) -> None:
    test = SequentialTest(good, good + gap, error, least, 14)
    assert _probability(test, good, State.BROKEN) <= error
    assert _probability(test, good + gap, State.SOUND) <= error


def _probability(test: SequentialTest, rate: float, state: State) -> float:
    """Of an end in this state, summed over all sequences of runs by their number of failures."""
    chances, found = {0: 1.0}, 0.0
    for runs in range(1, (test.most or 0) + 1):
        following: dict[int, float] = {}
        for failed, chance in chances.items():
            for more, share in ((1, rate), (0, 1 - rate)):
                end = _after(test, runs, failed + more)
                if end is state:
                    found += chance * share
                elif end is None:
                    following[failed + more] = following.get(failed + more, 0) + chance * share
        chances = following
    return found


def _after(test: SequentialTest, runs: int, failed: int) -> State | None:
    decision = test.after(runs, failed, runs - failed)
    return decision.state if decision.is_over else None
