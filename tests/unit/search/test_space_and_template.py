"""The space, the template and the criteria of a search."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.model.document.search.criteria import SearchProgress, criteria
from robovast.model.document.search.section import Search, SearchDimension
from robovast.model.document.search.space import at, holds, place, set_id, size
from robovast.model.document.search.template import doubtful, entry_of, markers


def dimension(**keys: Any) -> SearchDimension:
    return SearchDimension.model_validate(keys)


DIMENSIONS = [
    dimension(type="float", low=-1, high=2),
    dimension(type="float", low=0.01, high=100, log=True),
    dimension(type="float", low=3, high=3),
    dimension(type="int", low=0, high=11, step=4),
    dimension(type="int", low=1, high=1000, log=True),
    dimension(type="int", low=2, high=20, log=True, step=3),
    dimension(type="choice", values=["a", 1, True, None, [1, 2]]),
    dimension(type="bool"),
]


@given(st.floats(0, 1), st.sampled_from(DIMENSIONS))
def test_every_place_is_a_value_of_the_dimension_and_leads_back(unit: float, dim: Any) -> None:
    value = at(dim, unit)
    assert holds(dim, value)
    again = at(dim, place(dim, value))
    assert again == pytest.approx(value) if isinstance(value, float) else again == value


def test_every_value_of_a_raster_is_equally_likely() -> None:
    """0–11 in steps of 4 is 0, 4, 8, and never 11."""
    found = Counter(at(DIMENSIONS[3], i / 9999) for i in range(10000))
    assert set(found) == {0, 4, 8}
    assert max(found.values()) - min(found.values()) <= 2


def test_true_is_not_one_and_the_raster_is_kept() -> None:
    assert not holds(dimension(type="choice", values=[1, 2]), True)
    assert not holds(DIMENSIONS[3], 11)
    assert holds(DIMENSIONS[3], 8.0)
    assert size({"a": DIMENSIONS[3], "b": DIMENSIONS[7]}) == 6


def test_identifiers_are_those_of_the_existing_tool() -> None:
    assert set_id({"b": 1, "a": 0.5}) == set_id({"a": 0.5, "b": 1}) == "95c4de127995"


def section(**keys: Any) -> Search:
    space = {name: {"type": "int", "low": 0, "high": 9} for name in ("seed", "amount", "speed")}
    given = {"strategy": "random", "search_space": space, "objectives": [{"name": "f"}]}
    return Search.model_validate({**given, "budget": [{"batches": 3}], **keys})


def test_markers_are_replaced_with_their_type_and_the_rest_are_scenario_parameters() -> None:
    search = section(
        parameters=[{"speed": 1}, {"price": "$$5"}, {"pose": "@start"}],
        variations=[
            {"Obstacles": {"seed": "$seed", "of": [{"amount": "${amount}", "x": "a $seed"}]}}
        ],
    )
    entry = entry_of(search, {"seed": 3, "amount": 0, "speed": 7})
    assert entry.parameters == [{"speed": 7}, {"price": "$5"}, {"pose": "@start"}]
    assert entry.variations is not None
    assert entry.variations[0].parameters == {"seed": 3, "of": [{"amount": 0, "x": "a $seed"}]}
    template = [call.parameters for call in search.variations or []]
    assert {name for _, name in markers(template)} == {"seed", "amount"}
    assert [text for _, text in doubtful(template)] == ["a $seed"]


def fired(best: list[float | None], **keys: Any) -> list[str]:
    search = section(**keys)
    progress = SearchProgress(len(best), 10.0, best, {"coverage": 0.25})
    return [criterion.kind for criterion in criteria(search, progress) if criterion.fired]


def test_criteria() -> None:
    assert fired([1.0, 1.0]) == []
    assert fired([1.0, 1.0, 1.0]) == ["batches"]
    assert fired([None], budget=[{"time": 10}]) == ["time"]
    minimize = [{"name": "f", "direction": "minimize"}]
    assert fired([0.5], objectives=minimize, stopping=[{"target_objective": 0.5}]) == [
        "target_objective"
    ]
    assert fired([None], stopping=[{"target_objective": 0}]) == []
    patience = [{"no_improvement": {"patience": 2, "min_delta": 0.1}}]
    assert fired([1.0, 1.0], stopping=patience) == []
    assert fired([1.0, 1.05, 1.08], budget=[], stopping=patience) == ["no_improvement"]
    assert fired([1.0, 1.05, 1.15], budget=[], stopping=patience) == []
    assert fired([1.0], stopping=[{"metric": {"name": "coverage", "value": 0.2}}]) == ["metric"]
    assert fired([1.0], stopping=[{"metric": {"name": "coverag", "value": 0.2}}]) == []
