"""Intervals and tests say what SciPy says; those that may be looked at anytime hold anytime."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from robovast.base.statistics import (
    LEVEL,
    anytime,
    fisher_exact,
    holm,
    interval_text,
    least,
    mcnemar_exact,
    newcombe,
    paired_interval,
    percent,
    wilson,
)

COUNT = st.integers(0, 60)


@given(COUNT, COUNT)
def test_wilson_is_that_of_scipy(bad: int, good: int) -> None:
    if bad + good:
        known = stats.binomtest(bad, bad + good).proportion_ci(method="wilson")
        assert wilson(bad, bad + good) == pytest.approx((known.low, known.high), abs=1e-6)


def test_without_runs_every_rate_is_possible() -> None:
    assert wilson(0, 0) == anytime(0, 0) == (0.0, 1.0)


@given(COUNT, COUNT)
def test_anytime_ends_where_the_mixture_outweighs_a_rate_twenty_times(bad: int, good: int) -> None:
    low, high = anytime(bad, bad + good)
    runs = bad + good
    assert 0 <= low <= (bad / runs if runs else 0.5) <= high <= 1
    for limit in {low, high} - {0.0, 1.0}:
        weight = (runs + 1) * stats.binom.pmf(bad, runs, limit)
        assert weight == pytest.approx(LEVEL, rel=1e-6)


def test_anytime_holds_where_one_looks_after_every_five_runs_and_wilson_does_not() -> None:
    rng = random.Random(3)  # noqa: S311
    missed = {wilson: 0, anytime: 0}
    for _ in range(300):
        rate, bad = rng.uniform(0.02, 0.5), 0
        out = dict.fromkeys(missed, False)
        for runs in range(1, 101):
            bad += rng.random() < rate
            for interval in out if runs % 5 == 0 else ():
                low, high = interval(bad, runs)
                out[interval] |= not low <= rate <= high
        for interval, wrong in out.items():
            missed[interval] += wrong
    assert missed[anytime] <= 15
    assert missed[wilson] > 45


@pytest.mark.parametrize(
    ("table", "p"),
    [  # computed exactly, with rational numbers
        ((3, 1, 1, 3), 0.4857142857142857),
        ((8, 2, 1, 5), 0.03496503496503495),
        ((0, 10, 10, 0), 1.082508822446903e-05),
        ((10, 90, 30, 70), 0.000650410707603421),
        ((0, 5, 0, 7), 1.0),
        ((0, 0, 0, 0), 1.0),
    ],
)
def test_fisher_agrees_with_known_values(table: tuple[int, int, int, int], p: float) -> None:
    assert fisher_exact(*table) == pytest.approx(p, rel=1e-4)


@given(COUNT, COUNT, COUNT, COUNT)
def test_fisher_is_that_of_scipy(a: int, b: int, c: int, d: int) -> None:
    known = stats.fisher_exact([[a, b], [c, d]]).pvalue if a + b + c + d else 1.0
    assert fisher_exact(a, b, c, d) == pytest.approx(known, rel=1e-6)


def test_tests_of_very_many_runs_are_exact() -> None:
    assert fisher_exact(900, 99_100, 1000, 99_000) == pytest.approx(
        stats.fisher_exact([[900, 99_100], [1000, 99_000]]).pvalue, rel=1e-5
    )
    assert mcnemar_exact(50_500, 49_500) == pytest.approx(
        stats.binomtest(50_500, 100_000).pvalue, rel=1e-6
    )


@given(COUNT, COUNT, COUNT, COUNT)
def test_fisher_does_not_depend_on_what_is_called_what(a: int, b: int, c: int, d: int) -> None:
    p = fisher_exact(a, b, c, d)
    assert 0 < p <= 1
    assert p == pytest.approx(fisher_exact(c, d, a, b))
    assert p == pytest.approx(fisher_exact(b, a, d, c))


def test_newcombe_agrees_with_the_example_of_its_paper() -> None:
    low, high = newcombe(48, 80, 56, 70)
    assert (round(low, 4), round(high, 4)) == (0.0524, 0.3339)


def test_holm() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []


def test_the_least_number_that_is_enough() -> None:
    assert [least(lambda n: n >= 7, most) for most in (6, 7, 1000)] == [None, 7, 7]
    assert least(lambda n: True, 10) == 1


@given(COUNT, COUNT)
def test_mcnemar_is_the_sign_test_of_what_changed(worse: int, better: int) -> None:
    known = stats.binomtest(worse, worse + better).pvalue if worse + better else 1.0
    assert mcnemar_exact(worse, better) == pytest.approx(known)


@given(COUNT, COUNT, COUNT)
def test_an_interval_by_pairs_contains_the_difference(worse: int, better: int, same: int) -> None:
    pairs = worse + better + same
    low, high = paired_interval(worse, better, pairs)
    assert -1 <= low <= (worse - better) / (pairs or 1) <= high <= 1


def test_an_interval_by_pairs_agrees_with_an_example_by_hand() -> None:
    # 10 of 50 pairs got worse, 3 better: 7 / 52 ± 1.96 · √(14 - 49 / 52) / 52
    assert paired_interval(10, 3, 50) == pytest.approx((-0.00163, 0.27086), abs=1e-4)


def test_a_share_has_as_many_digits_as_people_read() -> None:
    shares = (0, 1e-17, 0.001, 0.0749, 0.0996, 0.12345, 1)
    told = ["0 %", "0 %", "0.1 %", "7.5 %", "10 %", "12 %", "100 %"]
    assert [percent(share) for share in shares] == told


def test_a_share_that_is_neither_none_nor_all_is_not_told_to_be_so() -> None:
    shares = (1e-5, 0.0004, 0.0005, 0.9949, 0.995, 0.996, 0.9994, 0.9996, 1 - 1e-17)
    told = ["<0.1 %", "<0.1 %", "0.1 %", "99 %", "99.5 %", "99.6 %", "99.9 %", ">99.9 %", "100 %"]
    assert [percent(share) for share in shares] == told
    assert interval_text((1e-5, 0.9996)) == "<0.1 – >99.9 %"
