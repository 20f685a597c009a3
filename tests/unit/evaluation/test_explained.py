"""Which factors a campaign's matrix begins with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.stored import NAME, write_campaign, write_run

from robovast.campaign.verdict import Verdict
from robovast.evaluation import factors
from robovast.evaluation.factors import Explanations, explain
from robovast.evaluation.library import Library
from robovast.evaluation.summaries import RunSummary, VariantRuns

GRID = {"plan": ["depot", "flat"], "path": ["1", "2"], "clutter": [0.25, 1.0], "margin": [0.02, 1]}


def robot(is_bad: Callable[[Mapping[str, Any]], bool]) -> list[VariantRuns]:
    """The robot's campaign: what came of its factors are files and poses."""
    variants = []
    for number, combination in enumerate(product(*GRID.values())):
        stated = dict(zip(GRID, combination, strict=True))
        files = {"map_file": f"{stated['plan']}.yaml", "mesh_file": f"{stated['plan']}.stl"}
        verdict = Verdict.FAILED if is_bad(stated) else Verdict.PASSED
        runs = (RunSummary(0, verdict, "", None, None),)
        variants.append(VariantRuns(f"v-{number}", "v", files, runs, {**stated, "goals": 1}))
    return variants


def test_the_matrix_begins_with_what_a_person_varied_and_what_matters() -> None:
    found = explain(robot(lambda of: of["margin"] == 0.02 and of["clutter"] == 1))
    assert set(found.axes) == {"margin", "clutter"}
    assert found.factors == list(GRID)


def test_without_failures_it_begins_with_the_first_that_vary() -> None:
    found = explain(robot(lambda _: False))
    assert (found.axes, found.effects) == (["plan", "path"], [])


def test_what_follows_from_the_other_is_no_second_axis() -> None:
    """Neither the file of the same plan nor each path's own pose."""
    variants = [
        VariantRuns(
            f"v-{number}",
            "v",
            {"plan": plan, "file": f"{plan}.yaml", "pose": [plan, path], "margin": margin},
            (RunSummary(0, Verdict.FAILED if plan == "a" else Verdict.PASSED, "", None, None),),
        )
        for number, (plan, path, margin) in enumerate(product("ab", "12", (1, 2)))
    ]
    found = explain(variants)
    assert found.axes == ["plan", "margin"]
    assert found.factors == ["plan", "pose", "margin"]
    assert found.same == {"plan": ["file"]}


def test_what_is_unlike_everywhere_comes_last() -> None:
    runs = (RunSummary(0, Verdict.PASSED, "", None, None),)
    variants = [
        VariantRuns(f"v-{n}", "v", {"name": f"n{n}", "speed": n % 3, "width": n // 3 % 5}, runs)
        for n in range(30)
    ]
    assert explain(variants).axes == ["speed", "width"]
    assert explain([]).axes == []


def test_an_analysis_is_kept_until_the_campaign_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = write_campaign(tmp_path, outputs=False)
    made: list[int] = []

    def counted(variants: list[VariantRuns]) -> factors.Explained:
        made.append(len(variants))
        return explain(variants)

    monkeypatch.setattr(factors, "explain", counted)
    explanations = Explanations(Library(tmp_path))
    first = explanations.of(NAME)
    assert explanations.of(NAME) == first
    assert made == [2]
    write_run(root, "hall-3", 0, 9, {"speed": 3.0}, lambda *_: "failed", outputs=False)
    version, found = explanations.of(NAME)
    assert (version > first[0], made) == (True, [2, 3])
    assert found.axes == ["speed"]
