"""How long a campaign takes, by those before it and by its own pace."""

from __future__ import annotations

import random
from dataclasses import replace
from math import isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from robovast.model.estimate import CampaignProgress, Spent, _student, forecast, remaining

times = st.floats(0.1, 1e5)
spent = st.builds(Spent, st.integers(1, 10_000), st.integers(1, 500), times)


@given(st.lists(spent, min_size=1, max_size=9), st.integers(1, 10_000), st.integers(1, 500))
def test_the_interval_has_the_estimate_in_it(earlier: list[Spent], runs: int, workers: int) -> None:
    found = forecast(earlier, runs, workers)
    assert found is not None
    assert 0 < found.least <= found.seconds <= found.most


def test_nothing_is_known_without_campaigns() -> None:
    assert forecast([], 100, 10) is None
    assert remaining(CampaignProgress(0, 100, 10, 10, 60)) is None


def test_twice_the_runs_take_twice_the_time_and_twice_the_pods_half_of_it() -> None:
    earlier = [Spent(100, 10, 600)] * 3
    times = [forecast(earlier, runs, pods) for runs, pods in ((100, 10), (200, 10), (100, 20))]
    assert [round(found.seconds) for found in times if found] == [600, 1200, 300]


def test_what_is_known_of_more_campaigns_is_known_better() -> None:
    few, many = (forecast([Spent(10, 1, 60)] * number, 10, 1) for number in (1, 10))
    assert few is not None
    assert many is not None
    assert many.most - many.least < (few.most - few.least) / 2


@pytest.mark.parametrize("freedom", [2, 3, 5, 20, 100])
def test_students_t_is_that_of_scipy(freedom: int) -> None:
    assert isclose(_student(freedom), t.ppf(0.95, freedom), rel_tol=0.02)


@given(
    st.builds(
        CampaignProgress,
        done=st.integers(1, 10_000),
        left=st.integers(0, 10_000),
        begun=st.floats(0, 10_000),
        workers=st.integers(1, 500),
        seconds=times,
        pack=st.floats(1, 500),
    ),
    st.floats(0, 0.99),
)
def test_what_remains_has_an_interval_that_ends_at_nothing(
    so_far: CampaignProgress, part: float
) -> None:
    found = remaining(replace(so_far, starts=part * so_far.seconds))
    assert found is not None
    assert 0 <= found.least <= found.seconds <= found.most
    assert (found.seconds == 0) == (so_far.left == 0)


@given(st.integers(1, 50), st.integers(1, 40), st.integers(2, 20), st.floats(1, 1e4))
def test_whenever_it_is_asked_packs_that_take_equally_long_end_within_the_interval(
    pack: int, workers: int, rounds: int, seconds: float
) -> None:
    """A pack has ended in each of `turn` rounds; the others of that round are about to."""
    for turn in range(1, rounds):
        for ended in {1, workers}:
            packs = (turn - 1) * workers + ended
            left = rounds * workers - packs
            so_far = CampaignProgress(
                packs * pack, left * pack, min(left, workers) * pack, workers, turn * seconds, pack
            )
            found = remaining(so_far)
            assert found is not None
            assert found.least <= (rounds - turn) * seconds <= found.most


def test_nine_of_ten_intervals_hold_for_campaigns_that_differ_by_load() -> None:
    dice = random.Random(1)  # noqa: S311
    held = []
    for _ in range(40):
        earlier: list[Spent] = []
        for _ in range(6):
            campaign = Spent(50, 5, 600 * dice.lognormvariate(0, 0.25))
            found = forecast(earlier, 50, 5)
            if found is not None:
                held.append(found.least <= campaign.seconds <= found.most)
            earlier.append(campaign)
    assert sum(held) >= 0.88 * len(held)
