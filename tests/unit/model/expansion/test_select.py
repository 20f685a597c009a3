"""Configurations are selected by name, by entry and by glob, by several of them, too."""

from __future__ import annotations

import pytest

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
    ],
)
def test_what_matches_any_pattern_is_selected_once_in_order(
    selection: Selection, chosen: list[str]
) -> None:
    assert [variant.name for variant in select_any(VARIANTS, selection)] == chosen


def test_a_pattern_among_others_that_matches_nothing_is_named() -> None:
    with pytest.raises(InputError, match=r"no configuration matches `hull`.*hall"):
        select_any(VARIANTS, ["depot", "hull"])
