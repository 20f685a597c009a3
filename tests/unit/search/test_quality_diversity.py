"""`qd`: sets that differ, the best of each kind; the same ones after any death."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robovast.model.document.search.section import Search
from robovast.search.strategies.archives import ArchiveParameters, cells_of
from robovast.search.strategies.quality_diversity import (
    QualityDiversityParameters,
    QualityDiversityStrategy,
)
from robovast.search.strategy import SearchStrategy
from robovast.search.types import Evaluation, ParamSet

SPACE = {name: {"type": "float", "low": -1.0, "high": 1.0} for name in "abcdefgh"}
AXES = {"x": {"low": -2.0, "high": 2.0, "bins": 12}, "y": {"low": -2.0, "high": 2.0, "bins": 12}}
GRID = {"measures": AXES}
CVT = {"type": "cvt", "cells": 100, "measures": AXES}


def strategy(
    archive: dict[str, Any], seed: int = 0, space: dict[str, Any] | None = None, **keys: Any
) -> QualityDiversityStrategy:
    cfg = Search.model_validate(
        {
            "strategy": "qd",
            "search_space": space or SPACE,
            "objectives": [{"name": "score", "direction": "minimize"}],
            "budget": [{"batches": 9}],
            "seed": seed,
        }
    )
    parameters = QualityDiversityParameters.model_validate({"archive": archive, **keys})
    return QualityDiversityStrategy(cfg, parameters)


def evaluate(params: ParamSet) -> Evaluation:
    """How uneven the joints of an arm are bent, and where its hand is."""
    joints = np.array(list(params.values.values()))
    around = np.cumsum(joints * np.pi)
    x, y = float(2 * np.cos(around).mean()), float(2 * np.sin(around).mean())
    return Evaluation(params, {"score": float(joints.var())}, {"x": x, "y": y}, 1)


def execute(made: SearchStrategy, batches: int) -> list[list[ParamSet]]:
    asked = []
    for _ in range(batches):
        asked.append(made.ask(10))
        made.tell([evaluate(params) for params in asked[-1]])
    return asked


@pytest.mark.parametrize("archive", [GRID, CVT])
def test_the_archive_fills_more_than_by_chance(archive: dict[str, Any]) -> None:
    made, drawn = strategy(archive), strategy(archive)
    execute(made, 30)
    units = np.random.default_rng(0).random((300, 8))
    drawn.tell([evaluate(drawn.set_at(unit)) for unit in units])
    found, chance = made.report().extra, drawn.report().extra
    assert found["coverage"] > 1.1 * chance["coverage"]
    assert (
        found["num_elites"] == len(found["elites"]) == round(found["coverage"] * made.cells.count)
    )
    total = sum(elite["objectives"]["score"] for elite in found["elites"])
    assert found["qd_score"] == pytest.approx(-total)
    assert len(made.report().evaluations) == 300


@pytest.mark.parametrize("archive", [GRID, CVT])
def test_it_is_a_function_of_seed_and_history(archive: dict[str, Any]) -> None:
    whole, rebuilt = strategy(archive, emitters=3), strategy(archive, emitters=3)
    asked = execute(whole, 4)
    assert [len(sets) for sets in asked] == [10] * 4, "as many as are asked, whatever the emitters"
    for sets in asked:
        rebuilt.repeat(10, sets)
        rebuilt.tell([evaluate(params) for params in sets])
    assert rebuilt.ask(10) == whole.ask(10)
    assert rebuilt.report() == whole.report()
    assert execute(strategy(archive, seed=1), 1) != asked[:1]


def test_a_cell_keeps_its_best_set() -> None:
    made = strategy(GRID)
    sets = [made.set_at([*[0.5] * 7, unit]) for unit in (0.5, 0.501, 0.502)]
    scores = (3.0, 1.0, 2.0)
    made.tell(
        [
            Evaluation(params, {"score": score}, {"x": 0.0, "y": 0.0}, 1)
            for params, score in zip(sets, scores, strict=True)
        ]
    )
    (elite,) = made.elites.values()
    assert elite.objectives["score"] == 1.0


def test_cells_are_even_and_the_outermost_hold_what_is_beyond() -> None:
    grid = cells_of(ArchiveParameters.model_validate(GRID), 0)
    assert grid.of({"x": -9.0, "y": -9.0}) == 0
    assert grid.of({"x": 9.0, "y": 2.0}) == grid.count - 1 == 143
    cvt = cells_of(ArchiveParameters.model_validate(CVT), 5)
    points = np.random.default_rng(1).uniform(-2, 2, (20_000, 2)).tolist()
    sizes = np.bincount([cvt.of({"x": x, "y": y}) for x, y in points], minlength=100)
    assert sizes.min() > 100, "200 are even"
    assert sizes.max() < 320


def test_a_small_space_is_proposed_once_then_nothing() -> None:
    space = {"a": {"type": "int", "low": 0, "high": 4}, "b": {"type": "bool"}}
    made = strategy({"measures": {"x": AXES["x"]}}, space=space)
    asked = []
    for _ in range(3):
        sets = made.ask(6)
        asked += [params.id for params in sets]
        made.tell([Evaluation(p, {"score": 0.0}, {"x": p.values["a"]}, 1) for p in sets])
    assert len(asked) == len(set(asked)) == 10


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"archive": {"measures": {}}}, "at least 1"),
        ({"archive": {"measures": {"x": {"low": 1, "high": 1}}}}, "needs `low` below `high`"),
        ({"archive": {"measures": {"x": {"low": 0, "high": float("inf")}}}}, "finite"),
        ({"archive": GRID, "emitters": -1}, "greater than or equal to 1"),
        ({"archive": GRID, "sigma": 0}, "greater than 0"),
        ({}, "Field required"),
    ],
)
def test_bad_parameters(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        QualityDiversityParameters.model_validate(keys)
