"""Records of newer versions: every reader says the same of them, and no writer takes a key away."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from support.campaigns.finished import finished_campaign

from robovast.analysis.provenance import write_graph, write_metadata
from robovast.analysis.tables.runs import run_rows
from robovast.campaign.layout import Layout
from robovast.campaign.run_files import FileList, read_list, write_list
from robovast.campaign.run_record import parse_known, parse_run_record
from robovast.evaluation.stored_runs import read_variant


def change(campaign: Path, **keys: object) -> str:
    path = campaign / "c-1/0/run.json"
    text = json.dumps({**json.loads(path.read_text()), **keys})
    path.write_text(text)
    return text


def told(campaign: Path) -> set[tuple[str, str]]:
    """Verdict and reason of c-1/0, as tables, metadata and the page have them."""
    [row] = run_rows(Layout(campaign), ["c-1/0"])
    data = yaml.safe_load(write_metadata(campaign).read_text())
    [entry] = [
        run
        for configuration in data["configurations"]
        for run in configuration["test_results"]
        if run["dir"] == "c-1/0"
    ]
    page = read_variant(campaign.parent, campaign.name, "c-1").runs[0]
    return {
        (row["verdict"], row["reason"]),
        (entry["verdict"], entry.get("reason", "")),
        (str(page.verdict), page.reason),
    }


@pytest.mark.parametrize("verdict", ["passed", "failed", "flaky"])
def test_a_record_of_a_newer_format_is_no_verdict_for_any_reader(
    tmp_path: Path, verdict: str
) -> None:
    campaign = finished_campaign(tmp_path, 3)
    change(campaign, schema=2, verdict=verdict)
    reason = "run.json was written by a newer version of RoboVAST"
    assert told(campaign) == {("errored", reason)}


def test_the_seed_is_in_tables_metadata_and_graph_when_the_record_has_one(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    change(campaign, seed=0)
    rows = run_rows(Layout(campaign), ["c-1/0", "c-2/0"])
    assert [row["seed"] for row in rows] == [0, None]
    described = yaml.safe_load(write_metadata(campaign).read_text())["configurations"]
    runs = {run["dir"]: run for part in described for run in part["test_results"]}
    assert runs["c-1/0"]["seed"] == 0
    assert "seed" not in runs["c-2/0"]
    graph = json.loads(write_graph(campaign).read_text())["@graph"]
    assert [node["seed"] for node in graph if "seed" in node] == [0]


@pytest.mark.parametrize("content", ["", "{}", "[" * 9999, '{"schema": null}', '{"schema": 1}'])
def test_without_a_record_all_readers_tell_by_the_test_result(tmp_path: Path, content: str) -> None:
    campaign = finished_campaign(tmp_path, 3)
    (campaign / "c-1/0/run.json").write_text(content)
    assert told(campaign) == {("passed", "run.json cannot be read, so test.xml decides")}


def test_a_test_result_that_cannot_be_read_either_decides_nothing(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    for name in ("run.json", "test.xml"):
        (campaign / "c-1/0" / name).write_text("")
    ((verdict, reason),) = told(campaign)
    assert verdict == "errored"
    assert reason.startswith("test.xml is not valid: ")
    assert reason.endswith("; run.json cannot be read")


def test_a_run_that_has_no_record_needs_no_note(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    (campaign / "c-1/0/run.json").unlink()
    assert told(campaign) == {("passed", "")}


def test_what_is_not_known_stays_when_a_record_is_written_again(tmp_path: Path) -> None:
    files = {"key": "k", "sha256": "s", "count": 1, "size": 2, "revision": 0, "packed": True}
    text = change(finished_campaign(tmp_path, 3), files=files, weather={"sun": 1}, unknown="x")
    record = parse_run_record(text)
    assert record is not None
    assert isinstance(record.files, FileList)
    again = json.loads(replace(record, files=record.files.revised()).to_json())
    assert again == {**json.loads(text), "files": {**files, "revision": 1}}


def test_what_is_not_known_stays_in_a_list_of_files() -> None:
    item = {"path": "a", "key": "k", "size": 1, "sha256": "s", "packed": True}
    listed = read_list(json.dumps({"files": [item]}).encode())
    assert [file.path for file in listed] == ["a"]
    assert json.loads(write_list(listed)) == {"files": [item]}


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"weather": "fair"},
        {"unknown": 1},
        {"schema": 2},
        {"verdict": "flaky"},
        {"run": "x"},
        {"reason": "cut \ud800"},
        {"files": {"path": 1}},
        {"duration": float("nan")},
        {"duration": 10**400},
    ],
)
def test_lists_read_a_record_as_everyone_does(tmp_path: Path, changes: dict[str, object]) -> None:
    text = change(finished_campaign(tmp_path, 3), **changes)
    for content in (text, text.encode(), text[:-9]):
        assert repr(parse_known(content)) == repr(parse_run_record(content))
