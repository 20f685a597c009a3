"""Tables and pictures of stored searches, whatever stands in their files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast.campaign.layout import SEARCH, Layout
from robovast.execution.generate import write_configurations
from robovast.model.document import load_document
from robovast.model.expansion import Composition
from robovast.model.packs import Block
from robovast.search.history import BatchOutcome, Proposal, Scored, SearchHistory
from robovast.search.pictures import draw_map, encoded
from robovast.search.results import stored_search
from robovast.search.types import ParamSet

DOCUMENT = """\
version: 1
metadata: {name: price}
execution: {scenario_file: scenario.osc}
search:
  strategy: boundary
  search_space:
    x: {type: int, low: 1, high: 9}
    kind: {type: choice, values: ["$5_^{ $", "$"]}
  objectives: [{name: failure_rate}]
  budget: [{batches: 3}]
"""
SCENARIO = """\
scenario test:
    x: int = 1
    kind: string = 'a'
    do serial:
        wait elapsed(1s)
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    (tmp_path / "scenario.osc").write_text(SCENARIO)
    (tmp_path / "test.vast").write_text(DOCUMENT)
    root = tmp_path / "results" / "price-2026-11-22-120000"
    write_configurations(load_document(tmp_path / "test.vast"), Composition(()), root, timings=True)
    sets = (ParamSet({"x": 1, "kind": "$5_^{ $"}), ParamSet({"x": 9, "kind": "$"}))
    history = SearchHistory(Layout(root))
    blocks = (Block(first_variant=0, variants=2, runs=2),)
    configs = tuple(f"c{params.id}" for params in sets)
    batch = history.propose(Proposal(2, "boundary", "1", 0, 0, sets, configs, blocks))
    rates = zip(sets, (0.0, 1.0), strict=True)
    scores = tuple(Scored(params.id, {"failure_rate": rate}, {}, 2) for params, rate in rates)
    history.finish(batch, BatchOutcome(scores, 1.0, 2.0))
    return root


def test_values_that_look_like_formulas_are_drawn_as_they_are(campaign: Path) -> None:
    figure = draw_map(stored_search(campaign), [], {})
    assert encoded(figure, Path("map.svg"))


@pytest.mark.parametrize("over", [["x"], ["x", "x"], ["x", "kind", "kind"]])
def test_a_map_is_drawn_over_two_dimensions(campaign: Path, over: list[str]) -> None:
    with pytest.raises(InputError, match="two different dimensions"):
        draw_map(stored_search(campaign), over, {})


@pytest.mark.parametrize(
    ("part", "change", "why"),
    [
        ("", lambda data: data["sets"][0]["values"].pop("x"), "is not in the search space"),
        ("", lambda data: data["sets"][0]["values"].update(x=99), "is not in the search space"),
        (".result", lambda data: data["scores"][0]["objectives"].clear(), "lacks an objective"),
    ],
)
def test_what_is_not_of_the_search_is_named(
    campaign: Path, part: str, change: Callable[[Any], None], why: str
) -> None:
    path = campaign / SEARCH / f"batch-0000{part}.json"
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=rf"batch-0000{part}\.json: .*{why}"):
        stored_search(campaign)


def test_what_the_strategy_cannot_be_told_is_its_error(campaign: Path) -> None:
    path = campaign / SEARCH / "batch-0000.result.json"
    path.write_text(path.read_text().replace('"failure_rate": 1.0', '"failure_rate": 7.0'))
    with pytest.raises(InputError, match=r"`boundary`: `replay` raised ValueError: .*a rate"):
        stored_search(campaign).map()
