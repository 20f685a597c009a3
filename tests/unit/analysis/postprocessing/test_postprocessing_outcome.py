from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robovast.analysis.postprocessing.outcome import NonsenseError, read_returned
from robovast.analysis.postprocessing.records import merge
from robovast.base.yaml_files import read_mapping

CAMPAIGN = Path("/results/camp")


def read(value: Any, base: Path = CAMPAIGN) -> Any:
    return read_returned(value, "plugin", base, CAMPAIGN)


def test_two_and_three_values() -> None:
    assert (read((True, "done")).success, read([False, "no "]).message) == (True, "no")
    entry = {"output": "a/0/x.csv", "sources": ["a/0/bag"], "plugin": "mine", "params": {"k": 1}}
    assert read((True, "", [entry])).entries == [entry]
    assert read((True, "", None)).entries == []


def test_paths_become_relative_to_the_campaign() -> None:
    entries = [{"output": "/results/camp/a/0/x.csv", "sources": "bag"}]
    entry = read((True, "", entries), CAMPAIGN / "a/0").entries[0]
    assert entry == {
        "output": "a/0/x.csv",
        "sources": ["a/0/bag"],
        "plugin": "plugin",
        "params": {},
    }


@pytest.mark.parametrize(
    "value",
    [None, True, (True,), ("yes", "x"), (True, 1), (True, "", {}), (True, "", ["x"]), (1, 2, 3, 4)],
)
def test_nonsense_is_named(value: Any) -> None:
    with pytest.raises(NonsenseError):
        read(value)


@pytest.mark.parametrize("output", ["../other/x.csv", "/etc/passwd", "a/../../x", "."])
def test_an_output_outside_is_refused(output: str) -> None:
    with pytest.raises(NonsenseError, match="outside of the campaign"):
        read((True, "", [{"output": output}]))


def test_entries_are_merged_into_the_run_that_they_are_about(tmp_path: Path) -> None:
    (tmp_path / "a/0").mkdir(parents=True)
    (tmp_path / "a/0/postprocessing.yaml").write_text("entries: [{output: a/0/y, plugin: p}]\nx: 1")
    entry = {"output": "a/0/x", "sources": [], "plugin": "p", "params": {}}
    merge(tmp_path, [entry, {**entry, "output": "summary.csv"}])
    merge(tmp_path, [{**entry, "sources": ["a/0/bag"]}])
    record = read_mapping(tmp_path / "a/0/postprocessing.yaml")
    assert record["x"] == 1
    assert [(e["output"], e.get("sources")) for e in record["entries"]] == [
        ("a/0/y", None),
        ("a/0/x", ["a/0/bag"]),
    ]
    own = read_mapping(tmp_path / "_transient/postprocessing.yaml")["entries"]
    assert [e["output"] for e in own] == ["summary.csv"]


def test_a_damaged_record_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a/0").mkdir(parents=True)
    (tmp_path / "a/0/postprocessing.yaml").write_bytes(b"\xff: [")
    merge(tmp_path, [{"output": "a/0/x", "sources": [], "plugin": "p", "params": {}}])
    assert len(read_mapping(tmp_path / "a/0/postprocessing.yaml")["entries"]) == 1
