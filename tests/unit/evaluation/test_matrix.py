"""Configurations in cells of two factors."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from robovast.base.serialization import spelled
from robovast.campaign.verdict import Verdict
from robovast.evaluation.matrix import MOST_GROUPS, RANGES, Cell, matrix
from robovast.evaluation.summaries import RunSummary, VariantRuns


def variants(factor: str, values: list[Any]) -> list[VariantRuns]:
    verdicts = (Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED, Verdict.INTERRUPTED)
    runs = tuple(RunSummary(n, verdict, "", None, None) for n, verdict in enumerate(verdicts))
    return [VariantRuns(f"v-{n}", "v", {factor: one}, runs) for n, one in enumerate(values)]


def test_interrupted_runs_do_not_count_and_values_are_in_order() -> None:
    found = matrix(variants("x", [10, 2, "b", None, 2]), ["x"])
    assert found.across.labels == ["2", "10", "b", "–"]
    assert found.down.labels == [""]
    assert found.cells == [[Cell(4, 6), Cell(2, 3), Cell(2, 3), Cell(2, 3)]]


VALUES = st.recursive(
    st.sampled_from([1, 2, 0.5, True, None, "1", "2", "0.5", "true", "null", "", " ", "a", "a "])
    | st.sampled_from(['"a"', "[1]", '["1", 2]', "NaN", "{}", "[1", "–x"]),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.just("k"), inner, max_size=1),
    max_leaves=3,
)


@given(st.lists(VALUES, min_size=2, max_size=6))
def test_values_of_different_types_are_never_one_group(values: list[Any]) -> None:
    found = matrix(variants("x", values), ["x"]).across
    kinds = [json.dumps(value) for value in values]
    assert len(set(zip(kinds, found.group, strict=True))) == len(set(kinds)) == len(found.labels)
    assert len(set(found.labels)) == len(found.labels)
    assert len({spelled(value) for value in values}) == len(set(kinds))


def test_equal_numbers_are_one_group() -> None:
    assert matrix(variants("x", [1, 1.0, "1"]), ["x"]).across.labels == ["1", '"1"']


def test_lists_are_in_order_item_by_item() -> None:
    values = [[10, 2], None, [2, 1], "b", [[2], 1], [2, 10], [2]]
    found = matrix(variants("x", values), ["x"])
    labels = ["b", "[2]", "[2, 1]", "[2, 10]", "[10, 2]", "[[2], 1]", "–"]
    assert found.across.labels == labels


def test_many_numbers_are_in_ranges_and_many_texts_beyond_the_first_together() -> None:
    found = matrix(variants("x", [n / 10 for n in range(100)]), ["x"])
    assert found.across.labels[:2] == ["0 … 1", "1 … 2"]
    assert [cell.runs for cell in found.cells[0]] == [30] * RANGES
    found = matrix(variants("x", [f"t{n:02}" for n in range(40)]), ["x"])
    assert (len(found.across.labels), found.across.labels[-1]) == (MOST_GROUPS + 1, "others")
    assert found.cells[0][-1].runs == 3 * (40 - MOST_GROUPS)


def test_a_pose_is_its_place_and_no_number_is_compared_that_is_none() -> None:
    pose = {"position": {"x": 3.925, "y": -3.175}, "orientation": {"yaw": 1.6}}
    found = matrix(variants("x", [float("nan"), pose, True]), ["x"])
    assert found.across.labels == ["NaN", "true", "3.92, -3.17"]


def test_a_campaign_without_factors_is_one_cell() -> None:
    found = matrix(variants("x", [1, 2]), [])
    assert (found.across.labels, found.cells) == ([""], [[Cell(4, 6)]])
