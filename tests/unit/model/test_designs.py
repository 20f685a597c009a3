"""Which combinations designs choose: as many, spread as promised, and the same everywhere."""

from __future__ import annotations

import math
import time
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc

from robovast.model.designs import MOST_SOBOL, count_of, coverage, coverages, rows_of
from robovast.model.document.model import Design

SIZES = st.lists(st.integers(1, 6), min_size=1, max_size=5)

PAIRWISE = [
    (0, 0, 0),
    (0, 0, 2),
    (0, 0, 3),
    (0, 1, 1),
    (1, 0, 1),
    (1, 1, 0),
    (1, 1, 2),
    (1, 1, 3),
    (2, 0, 0),
    (2, 0, 2),
    (2, 0, 3),
    (2, 1, 1),
]
RANDOM = [(0, 1, 1), (1, 0, 1), (1, 1, 0), (2, 0, 2)]
LHS = [(0, 0, 3), (0, 1, 2), (1, 0, 1), (2, 1, 0)]
SOBOL = [(0, 1, 3), (1, 0, 0), (1, 0, 1), (2, 1, 2)]


def design(kind: str, count: int | None = None, seed: int = 0) -> Design:
    given = {"kind": kind} if count is None else {"kind": kind, "count": count, "seed": seed}
    return Design.model_validate(given)


def test_all_versions_choose_these() -> None:
    """Results are compared by configuration: another choice would make other names."""
    sizes = [3, 2, 4]
    assert rows_of(design("pairwise"), sizes) == PAIRWISE
    assert rows_of(design("random", 4, 1), sizes) == RANDOM
    assert rows_of(design("lhs", 4, 1), sizes) == LHS
    assert rows_of(design("sobol", 4, 1), sizes) == SOBOL


@given(SIZES, st.sampled_from(["random", "lhs", "sobol"]), st.data())
def test_a_design_has_as_many_different_combinations_as_it_says(sizes, kind, data) -> None:
    count = data.draw(st.integers(1, math.prod(sizes)))
    chosen = design(kind, count, data.draw(st.integers(0, 9)))
    rows = rows_of(chosen, sizes)
    assert len(rows) == len(set(rows)) == count == count_of(chosen, sizes)
    assert rows == sorted(rows)
    assert all(value < size for row in rows for value, size in zip(row, sizes, strict=True))


@given(SIZES)
def test_pairwise_covers_all_pairs_with_fewer_combinations(sizes) -> None:
    rows = rows_of(design("pairwise"), sizes)
    covered, all_ = coverage(rows, sizes, 2)
    assert covered == all_
    assert coverage(rows, sizes, 1) == (sum(sizes), sum(sizes))
    assert len(rows) <= math.prod(sizes)
    assert rows_of(design("full"), sizes)[-1] == tuple(size - 1 for size in sizes)


def test_pairwise_is_small() -> None:
    sizes = {(3,) * 4: 9, (3,) * 13: 21, (10,) * 10: 165, (2,) * 20: 11}
    assert {
        s: count_of(design("pairwise"), s) <= most for s, most in sizes.items()
    } == dict.fromkeys(sizes, True)


def test_a_latin_hypercube_takes_each_value_equally_often() -> None:
    rows = rows_of(design("lhs", 60), [5, 4, 6, 3, 10])
    for axis, size in enumerate([5, 4, 6, 3, 10]):
        assert set(Counter(row[axis] for row in rows).values()) == {60 // size}


def test_sobol_is_that_of_scipy_shifted_by_its_digits() -> None:
    size = 2**10
    rows = rows_of(design("sobol", 64, 3), [size] * MOST_SOBOL)
    points = qmc.Sobol(MOST_SOBOL, scramble=False).random_base2(6)
    expected = {tuple(int(x * size) for x in point) for point in points}
    shifts = {tuple(a ^ b for a, b in zip(rows[0], point, strict=True)) for point in expected}
    assert any(
        {tuple(a ^ b for a, b in zip(shift, p, strict=True)) for p in expected} == set(rows)
        for shift in shifts
    )


@pytest.mark.parametrize("kind", ["random", "lhs", "sobol"])
def test_seeds_choose_differently(kind: str) -> None:
    sizes = [9, 9, 9]
    assert rows_of(design(kind, 9, 1), sizes) != rows_of(design(kind, 9, 2), sizes)


def test_few_of_a_huge_product_are_chosen_at_once() -> None:
    assert len(rows_of(design("random", 1000), [1000] * 16)) == 1000


def test_the_pairs_of_two_long_lists_are_covered_at_once() -> None:
    started = time.process_time()
    assert count_of(design("pairwise"), [300, 300]) == 90_000
    assert time.process_time() - started < 30  # looking through all that is left takes minutes


def test_triples_of_very_many_variations_are_not_counted() -> None:
    assert set(coverages([(0,) * 2000], [2] * 2000)) == {"values", "pairs"}
    assert coverages([(0, 1, 0)], [2] * 3) == {
        "values": (3, 6),
        "pairs": (3, 12),
        "triples": (1, 8),
    }
