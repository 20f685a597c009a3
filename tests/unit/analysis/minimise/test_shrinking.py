"""Parameters become as mild as a predicate allows."""

from __future__ import annotations

import sys
import tracemalloc
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.analysis.minimise.shrinking import Items, Ladder, Parameters, shrink


class Asked:
    """Whether parameters fail, and how many different ones were asked for."""

    def __init__(self, fails: Any) -> None:
        self._fails = fails
        self.known: dict[str, bool] = {}

    def __call__(self, parameters: Parameters) -> bool:
        key = repr(sorted(parameters.items()))
        return self.known.setdefault(key, self._fails(parameters))


def test_of_many_items_those_that_fail_together_are_left() -> None:
    asked = Asked(lambda p: {17, 71} <= set(p["items"]))
    assert shrink({"items": list(range(100))}, [Items("items")], asked) == {"items": [17, 71]}
    assert len(asked.known) < 100


def test_what_fails_without_any_item_has_none() -> None:
    asked = Asked(lambda _: True)
    assert shrink({"items": [3, 1]}, [Items("items")], asked) == {"items": []}
    assert len(asked.known) == 1


def test_the_mildest_value_that_fails_is_found_by_bisection() -> None:
    asked = Asked(lambda p: p["speed"] >= 11)
    values = tuple(range(17))
    assert shrink({"speed": 16}, [Ladder("speed", values)], asked) == {"speed": 11}
    assert len(asked.known) <= 6


def test_what_depends_on_each_other_is_made_milder_until_nothing_helps() -> None:
    ladder = Ladder("margin", (0.1, 0.05, 0.02))
    asked = Asked(lambda p: len(p["boxes"]) >= (3 if p["margin"] > 0.02 else 1) and p["on"])
    reductions = [Items("boxes"), Ladder("on", (False, True)), ladder]
    found = shrink({"boxes": ["a", "b", "c"], "margin": 0.02, "on": True}, reductions, asked)
    assert found == {"boxes": ["a"], "margin": 0.02, "on": True}


def test_a_long_list_needs_the_memory_of_few_such_lists() -> None:
    items = list(range(400))
    tracemalloc.start()
    try:
        shrink({"items": items}, [Items("items")], lambda p: p["items"] == items)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 30 * sys.getsizeof(items)


@settings(max_examples=200)
@given(st.sets(st.integers(0, 15)), st.integers(0, 16), st.integers(0, 40))
def test_no_single_step_leads_to_milder_parameters_that_fail(
    needed: set[int], least: int, pair: int
) -> None:
    def fails(p: Parameters) -> bool:
        return needed <= set(p["items"]) and p["x"] >= least and len(p["items"]) + p["x"] >= pair

    start = {"items": list(range(16)), "x": 16}
    if not fails(start):
        return
    found = shrink(start, [Items("items"), Ladder("x", tuple(range(17)))], fails)
    assert fails(found)
    assert not (found["x"] and fails({**found, "x": found["x"] - 1}))
    for item in found["items"]:
        assert not fails({**found, "items": [i for i in found["items"] if i != item]})
