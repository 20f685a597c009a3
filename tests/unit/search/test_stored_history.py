"""Stored batches that were changed by hand are refused in words, and named."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import ExitCode, InputError
from robovast.campaign.layout import SEARCH, Layout
from robovast.model.packs import SETS_LIMIT, Block
from robovast.search.history import Batch, BatchOutcome, Proposal, Scored, SearchHistory
from robovast.search.local import SearchSummary
from robovast.search.types import ParamSet
from robovast_cli.ui.campaign import exit_code


def stored(root: Path) -> Path:
    history = SearchHistory(Layout(root))
    for x in range(3):
        params = ParamSet({"x": x})
        blocks = (Block(first_variant=x, variants=1, runs=1),)
        made = Proposal(1, "random", "1", 0, x, (params,), (f"c{x}",), blocks)
        batch = history.propose(made)
        history.repeat(batch, blocks)
        history.finish(batch, BatchOutcome((Scored(params.id, {"rate": 1.0}),), 1.0, 2.0))
    assert SearchHistory(Layout(root)).batches == history.batches
    return root / SEARCH


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
    with pytest.raises(InputError, match=rf"batch-0001{part}\.json: .*Restore it from a copy"):
        SearchHistory(Layout(tmp_path))


def test_a_pipe_or_a_file_without_end_is_no_batch(tmp_path: Path) -> None:
    path = stored(tmp_path) / "batch-0001.json"
    os.truncate(path, 6 << 30)
    with pytest.raises(InputError, match=r"batch-0001\.json: cannot be used"):
        SearchHistory(Layout(tmp_path))
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"batch-0001\.json: cannot be used"):
        SearchHistory(Layout(tmp_path))


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_batch_that_was_deleted_is_named(tmp_path: Path, number: int) -> None:
    (stored(tmp_path) / f"batch-000{number}.json").unlink()
    with pytest.raises(InputError, match=rf"batch-000{number}\.json: is missing"):
        SearchHistory(Layout(tmp_path))


@pytest.mark.parametrize("number", [0, 1])
def test_the_result_of_a_batch_that_was_deleted_is_named(tmp_path: Path, number: int) -> None:
    (stored(tmp_path) / f"batch-000{number}.result.json").unlink()
    with pytest.raises(InputError, match=rf"batch-000{number}\.result\.json: is missing"):
        SearchHistory(Layout(tmp_path))


def test_a_batch_that_is_stored_meanwhile_is_not_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, read = stored(tmp_path) / "batch-0002.json", SearchHistory._load
    (path.parent / "batch-0002.result.json").unlink()
    (path.parent / "batch-0002.again.json").unlink()
    later = path.read_text()
    path.unlink()

    def slow(self: SearchHistory, number: int, part: str, kind: Any) -> Any:
        path.write_text(later)
        return read(self, number, part, kind)

    monkeypatch.setattr(SearchHistory, "_load", slow)
    assert [batch.number for batch in SearchHistory(Layout(tmp_path)).batches] == [0, 1]
    assert [batch.number for batch in SearchHistory(Layout(tmp_path)).open] == [2]


def test_more_than_ten_thousand_batches_are_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = stored(tmp_path)
    for number, name in enumerate(["9998", "9999", "10000"]):
        for path in folder.glob(f"batch-000{number}.*"):
            path.rename(folder / path.name.replace(f"000{number}", name))
    first = [Batch(n, Proposal(1, "", "", 0, n, (), (), ())) for n in range(9998)]
    for batch in first:
        batch.outcome = BatchOutcome((), 0.0, 0.0)
        for part in ("", ".result"):
            (folder / f"batch-{batch.number:04d}{part}.json").touch()
    load = SearchHistory._load

    def quick(self: SearchHistory, number: int, part: str, kind: Any) -> Any:
        if number >= len(first):
            return load(self, number, part, kind)
        return first[number].outcome if part else first[number].proposal

    monkeypatch.setattr(SearchHistory, "_load", quick)
    assert len(SearchHistory(Layout(tmp_path)).finished) == 10_001


def test_a_batch_of_as_many_sets_as_may_be_asked_for_is_read_again(tmp_path: Path) -> None:
    sets = tuple(ParamSet({"x": x}) for x in range(SETS_LIMIT))
    configs = tuple(f"c{params.id}" for params in sets)
    measures = {f"measure {n}": n / 3 for n in range(30)}
    history = SearchHistory(Layout(tmp_path))
    batch = history.propose(Proposal(SETS_LIMIT, "random", "1", 0, 0, sets, configs, ()))
    scores = tuple(Scored(params.id, {"rate": 1.0}, measures) for params in sets)
    history.finish(batch, BatchOutcome(scores, 1.0, 2.0))
    assert len(SearchHistory(Layout(tmp_path)).scores()) == SETS_LIMIT


def test_a_search_that_scored_nothing_has_no_verdict(tmp_path: Path) -> None:
    assert exit_code(SearchSummary(tmp_path, 1, [])) is ExitCode.OK
    assert exit_code(SearchSummary(tmp_path, 1, [], sets=1, errors=["no"])) is ExitCode.RUN_ERRORED


def test_the_plan_grows_in_the_order_in_which_its_runs_were_added(tmp_path: Path) -> None:
    """The second batch was proposed alone, the third while the second was executed."""
    history = SearchHistory(Layout(tmp_path))
    params = ParamSet({"x": 1})

    def proposed(ahead: int, variant: int) -> Batch:
        blocks = (block(variant, 0),)
        return history.propose(
            Proposal(1, "random", "1", 0, 0, (params,), ("c",), blocks, ahead=ahead)
        )

    def block(variant: int, first_run: int) -> Block:
        return Block(first_variant=variant, variants=1, first_run=first_run, runs=1)

    first = proposed(0, 0)
    history.repeat(first, [block(0, 1)])
    history.finish(first, BatchOutcome((Scored(params.id),), 1.0, 2.0))
    second, _ = proposed(0, 1), proposed(1, 2)
    history.repeat(second, [block(1, 1)])
    expected = [block(0, 0), block(0, 1), block(1, 0), block(2, 0), block(1, 1)]
    assert history.blocks == expected
    assert SearchHistory(Layout(tmp_path)).blocks == expected


def test_a_batch_cannot_have_been_proposed_before_the_first_one(tmp_path: Path) -> None:
    history = SearchHistory(Layout(tmp_path))
    history.propose(Proposal(1, "random", "1", 0, 0, (), (), (), ahead=1))
    with pytest.raises(InputError, match=r"batch-0000\.json: .*`ahead` must be from 0 to 0"):
        SearchHistory(Layout(tmp_path))
