"""The searches among the examples, from the grid beside them to maps, archives and worst cases."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import EXAMPLES, Recorder
from support.optional import needs

from robovast.base.errors import InputError
from robovast.execution.local import LocalOptions
from robovast.model.document import load_document
from robovast.search.local import SearchSummary, execute_document
from robovast.search.pictures import draw_map, draw_progress, encoded
from robovast.search.results import stored_search

needs("optuna")

DRONE = EXAMPLES / "drone_landing"


def shortened(folder: Path, name: str, batches: int = 2) -> Path:
    """A search of the example with few small batches."""
    shutil.copytree(DRONE, folder)
    path = folder / f"search_{name}.vast"
    text = re.sub(r"per_batch: \d+", "per_batch: 3", path.read_text())
    path.write_text(re.sub(r"batches: \d+", f"batches: {batches}", text))
    return path


def execute(path: Path, **options: Any) -> SearchSummary:
    chosen = LocalOptions(**{"runtime": "process", "runs": 1, **options})
    summary = execute_document(load_document(path), path.parent / "out", chosen, Recorder())
    assert isinstance(summary, SearchSummary)
    assert summary.stop is not None
    assert summary.stop.kind == "batches"
    return summary


@pytest.mark.parametrize("name", ["random", "optuna", "qd", "boundary"])
def test_a_search_of_each_kind(tmp_path: Path, name: str) -> None:
    """Five dimensions, a variation, a command and an extractor in files of their own."""
    summary = execute(shortened(tmp_path / "in", name))
    stored = stored_search(summary.campaign)
    answer = stored.sets()
    rows = [dict(zip(answer.columns, row, strict=True)) for row in answer.rows]
    assert len(rows) == len(summary.records) == 6
    for row in rows:
        assert row["error"] == ""
        gust = 0.25 * row["wind"] * (1 - row["shelter"])
        record = json.loads((summary.campaign / row["config"] / "0" / "run.json").read_text())
        assert record["parameters"]["gust"] == pytest.approx(gust)
        assert (record["verdict"] == "failed") == (row["failure_rate"] == 1.0)
    if name == "qd":
        (cell, config, *_), *_ = stored.archive().rows
        assert 0 <= cell < 512
        assert (summary.campaign / str(config) / "0" / "metrics.csv").is_file()


def test_pictures_of_a_search_and_what_cannot_be_drawn(tmp_path: Path) -> None:
    stored = stored_search(execute(shortened(tmp_path / "in", "boundary")).campaign)
    figure = draw_map(stored, ["mass", "gain"], {"wind": 8.0})
    assert encoded(figure, Path("map.png")).startswith(b"\x89PNG")
    assert b"<svg" in encoded(draw_progress(stored), Path("progress.SVG"))
    for over, fixed, message in (
        (
            ["mass", "gian"],
            {},
            "`gian` is not a dimension of the search space. Did you mean `gain`?",
        ),
        (["mass", "mass"], {}, "two different dimensions"),
        (["mass"], {}, "two different dimensions"),
        ([], {"wind": 99.0}, "wind = 99.0 is not in the search space"),
    ):
        with pytest.raises(InputError, match=message):
            draw_map(stored, over, fixed)
    with pytest.raises(InputError, match=r"must end in \.png or \.svg"):
        encoded(figure, Path("map.jpg"))


def test_the_example_has_the_grid_that_the_searches_replace() -> None:
    document = load_document(DRONE / "drone_landing.vast")
    assert document.vast.search is None
