"""Configurations are selected by name, by entry and by glob, by several of them, too."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.model.expansion import Selection, Variant, select_any

VARIANTS = [Variant(f"{entry}-{i}", entry, {}) for entry in ("hall", "depot") for i in (1, 2)]


@pytest.mark.parametrize(
    ("selection", "chosen"),
    [
        (None, ["hall-1", "hall-2", "depot-1", "depot-2"]),
        ([], ["hall-1", "hall-2", "depot-1", "depot-2"]),
        ("hall", ["hall-1", "hall-2"]),
        ("*-2", ["hall-2", "depot-2"]),
        (["depot-1", "hall", "*-1"], ["hall-1", "hall-2", "depot-1"]),
        ("1/3", ["hall-1", "depot-2"]),
        ("2/3", ["hall-2"]),
        (["2/2", "hall", "depot-1"], ["hall-2"]),
    ],
)
def test_what_matches_any_pattern_is_selected_once_in_order(
    selection: Selection, chosen: list[str]
) -> None:
    assert [variant.name for variant in select_any(VARIANTS, selection)] == chosen


def test_a_pattern_among_others_that_matches_nothing_is_named() -> None:
    with pytest.raises(InputError, match=r"no configuration matches `hull`.*hall"):
        select_any(VARIANTS, ["depot", "hull"])


@given(st.integers(1, 40), st.integers(1, 40))
def test_each_configuration_is_in_one_of_the_parts_which_are_as_equal_as_possible(
    number: int, of: int
) -> None:
    variants = [Variant(f"v-{i}", "v", {}) for i in range(number)]
    parts = [select_any(variants, f"{n}/{of}") for n in range(1, min(number, of) + 1)]
    assert sorted(v.name for part in parts for v in part) == sorted(v.name for v in variants)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        ("3/2", "invalid part `3/2`: the number must be between 1 and 2"),
        ("0/2", "invalid part `0/2`: the number must be between 1 and 2"),
        ("5/5", "there are only 4 configurations"),
    ],
)
def test_a_part_that_is_empty_is_refused(pattern: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        select_any(VARIANTS, pattern)
