"""Stored batches that were changed by hand are refused in words, and named."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import ExitCode, InputError
from robovast.campaign.layout import Layout
from robovast.model.document.model import SETS_LIMIT
from robovast.model.packs import Block
from robovast.search.history import FOLDER, History, Outcome, Proposal, Scored
from robovast.search.local import SearchSummary
from robovast.search.types import ParamSet
from robovast_cli.ui.campaign import exit_code


def stored(root: Path) -> Path:
    history = History(Layout(root))
    for x in range(3):
        params = ParamSet({"x": x})
        blocks = (Block(first_variant=x, variants=1, runs=1),)
        made = Proposal(1, "random", "1", 0, x, (params,), (f"c{x}",), blocks)
        batch = history.propose(made)
        history.repeat(batch, blocks)
        history.finish(batch, Outcome((Scored(params.id, {"rate": 1.0}),), 1.0, 2.0))
    assert History(Layout(root)).batches == history.batches
    return root / FOLDER


def changed(**values: Any) -> Any:
    return lambda data: json.dumps(data | values)


def without(key: str) -> Any:
    return lambda data: json.dumps({k: v for k, v in data.items() if k != key})


@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("", lambda _: "[]"),
        ("", lambda _: "{"),
        ("", lambda _: "[" * 200_000),
        ("", without("sets")),
        ("", changed(other=1)),
        ("", changed(configs=[])),
        ("", changed(configs=["../../x"])),
        ("", changed(configs=["/x"])),
        ("", changed(sets=[{"values": 3}])),
        ("", changed(blocks={"a": 1})),
        (".again", lambda _: "{}"),
        (".result", lambda _: "[]"),
        (".result", changed(scores=[])),
        (".result", changed(elapsed="long")),
        (".result", without("finished_at")),
    ],
)
def test_a_changed_batch_is_named(tmp_path: Path, part: str, change: Any) -> None:
    path = stored(tmp_path) / f"batch-0001{part}.json"
    path.write_text(change(json.loads(path.read_text())))
    with pytest.raises(InputError, match=rf"batch-0001{part}\.json: .*restore it from a copy"):
        History(Layout(tmp_path))


def test_a_pipe_or_a_file_without_end_is_no_batch(tmp_path: Path) -> None:
    path = stored(tmp_path) / "batch-0001.json"
    os.truncate(path, 6 << 30)
    with pytest.raises(InputError, match=r"batch-0001\.json: cannot be used"):
        History(Layout(tmp_path))
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"batch-0001\.json: cannot be used"):
        History(Layout(tmp_path))


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_batch_that_was_deleted_is_named(tmp_path: Path, number: int) -> None:
    (stored(tmp_path) / f"batch-000{number}.json").unlink()
    with pytest.raises(InputError, match=rf"batch-000{number}\.json: is missing"):
        History(Layout(tmp_path))


def test_a_batch_of_as_many_sets_as_may_be_asked_for_is_read_again(tmp_path: Path) -> None:
    sets = tuple(ParamSet({"x": x}) for x in range(SETS_LIMIT))
    configs = tuple(f"c{params.id}" for params in sets)
    measures = {f"measure {n}": n / 3 for n in range(30)}
    history = History(Layout(tmp_path))
    batch = history.propose(Proposal(SETS_LIMIT, "random", "1", 0, 0, sets, configs, ()))
    scores = tuple(Scored(params.id, {"rate": 1.0}, measures) for params in sets)
    history.finish(batch, Outcome(scores, 1.0, 2.0))
    assert len(History(Layout(tmp_path)).scores()) == SETS_LIMIT


def test_a_search_that_scored_nothing_has_no_verdict(tmp_path: Path) -> None:
    assert exit_code(SearchSummary(tmp_path, 1, [])) is ExitCode.OK
    assert exit_code(SearchSummary(tmp_path, 1, [], scored=False)) is ExitCode.RUN_ERRORED
