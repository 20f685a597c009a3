"""What assistants learn about a search: who proposed its sets, from what, and their scores."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from robovast.base.errors import InputError, RobovastError
from robovast.campaign.layout import Layout
from robovast.evaluation.library import Library
from robovast.mcp.searches import SearchTools
from robovast.model.packs import Block
from robovast.search.history import BatchOutcome, Proposal, Scored, SearchHistory
from robovast.search.types import ParamSet

NAME = "search-2026-11-22-120000"


@pytest.fixture
def tools(tmp_path: Path) -> SearchTools:
    for name in (NAME, "plain-2026-11-22-120000"):
        (tmp_path / name / "_config").mkdir(parents=True)
        (tmp_path / name / "_execution").mkdir()
    history = SearchHistory(Layout(tmp_path / NAME))
    for number in range(2):
        sets = tuple(ParamSet({"x": 2 * number + place}) for place in range(2))
        blocks = (Block(first_variant=2 * number, variants=2, runs=1),)
        configs = tuple(f"c{params.id}" for params in sets)
        made = Proposal(2, "boundary", "1.2", 7, 2 * number, sets, configs, blocks)
        batch = history.propose(made)
        if number == 0:
            scores = (
                Scored(sets[0].id, {"failure_rate": 0.5}, {"error": 3.0}, 4),
                Scored(sets[1].id, error="no run came to a verdict"),
            )
            history.finish(batch, BatchOutcome(scores, 9.5, 2.0, {"failing": 0.25}))
    return SearchTools(Library(tmp_path))


def test_a_batch_says_who_proposed_it_from_how_much(tools: SearchTools) -> None:
    first, second = tools.get_search(NAME)["batches"]
    assert first == {
        "batch": 0, "strategy": "boundary", "version": "1.2", "seed": 7, "told": 0, "known": 0,
        "sets": 2, "metrics": {"failing": 0.25}, "elapsed": 9.5,
    }  # fmt: skip
    assert (second["told"], second["known"], second["metrics"]) == (2, 1, None)


def test_a_set_has_its_configuration_and_its_score(tools: SearchTools) -> None:
    found = tools.list_search_sets(NAME)
    assert found["total"] == 4
    one, other, *under_way = found["sets"]
    assert (one["values"], one["objectives"], one["measures"]) == (
        {"x": 0}, {"failure_rate": 0.5}, {"error": 3.0},
    )  # fmt: skip
    assert (one["config"], one["n_samples"]) == (f"c{ParamSet({'x': 0}).id}", 4)
    assert other["error"] == "no run came to a verdict"
    assert all("objectives" not in row for row in under_way)
    assert len(tools.list_search_sets(NAME, offset=3)["sets"]) == 1


def test_batches_that_are_links_out_are_not_read(tools: SearchTools, tmp_path: Path) -> None:
    for name, link in (("one", "_execution/search"), ("two", "_execution/search/batch-0000.json")):
        trap = tmp_path / f"{name}-2026-01-02-000000"
        (trap / "_execution").mkdir(parents=True)
        (trap / link).parent.mkdir(exist_ok=True)
        away = tmp_path.parent / f"away-{tmp_path.name}"
        shutil.copytree(tmp_path / NAME / "_execution/search", away, dirs_exist_ok=True)
        (trap / link).symlink_to(away / Path(link).name if name == "two" else away)
        with pytest.raises(RobovastError):
            tools.list_search_sets(trap.name)


def test_what_is_no_search_is_refused(tools: SearchTools) -> None:
    with pytest.raises(InputError, match="is not a search"):
        tools.get_search("plain-2026-11-22-120000")
    with pytest.raises(RobovastError, match="There is no campaign"):
        tools.get_search("../elsewhere")
