"""`vast results metadata` and `vast results sparql`, as a user sees them."""

from __future__ import annotations

import csv
import io
import json
import logging
import sys
from pathlib import Path

import pytest
from support.campaigns.described import NAME, make_old_campaign


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The results folder of the working directory, with one campaign."""
    make_old_campaign(tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results"


def test_metadata_and_graph_are_written(vast, results: Path) -> None:
    outcome = vast("results", "metadata")
    assert (outcome.code, outcome.out) == (
        0,
        f"results/{NAME}: metadata.yaml, metadata.prov.json\n",
    )


def test_a_campaign_can_be_the_working_directory(vast, results: Path, monkeypatch) -> None:
    monkeypatch.chdir(results / NAME)
    assert vast("results", "generate-metadata", "-r", ".").code == 0
    assert (
        f"/halls/{NAME}/hall-1-2/0"
        in vast("results", "sparql", "failed-runs", "-r", ".", "-o", "csv").out
    )


def test_a_fault_in_one_campaign_stops_no_other(vast, results: Path, caplog) -> None:
    bad = make_old_campaign(results, 1, 1, name="bad-2026-01-01-000000")
    (bad / "_config/plans.py").write_text("raise SystemError('no')\n")
    with caplog.at_level(logging.WARNING):
        outcome = vast("results", "metadata")
    assert outcome.code == 2
    assert outcome.out.endswith(f"results/{NAME}: metadata.yaml, metadata.prov.json\n")
    (message,) = caplog.messages
    assert "plans.py" in message
    assert "SystemError: no" in message
    assert (bad / "metadata.prov.json").is_file()


def test_queries_are_listed(vast, results: Path) -> None:
    listed = vast("results", "sparql", "--list").out
    assert listed == vast("results", "sparql").out
    assert "\nfailure-rate              Percentage of unsuccessful runs" in listed


@pytest.fixture
def described(vast, results: Path) -> Path:
    vast("results", "metadata")
    return results


def test_a_table_has_short_iris(vast, described: Path) -> None:
    head, *rows, _, count = vast("results", "sparql", "failure-rate").out.splitlines()
    assert head == "env_model         result  total"
    assert sorted(rows) == ["_config/hall.fpm  0       2", "_config/ramp.fpm  50      2"]
    assert count == "2 rows"


def test_csv_and_json_have_whole_iris(vast, described: Path) -> None:
    table = vast("results", "sparql", "failed-runs", "-o", "csv").out
    rows = list(csv.DictReader(io.StringIO(table)))
    same = json.loads(vast("results", "sparql", "failed-runs", "-o", "json").out)
    assert rows == same
    assert rows[0]["run"] == f"https://example.org/datasets/halls/{NAME}/hall-1-2/0"
    assert rows[0]["reason"] == "it hit the wall"


def test_a_query_comes_from_a_file_or_standard_input(
    vast, described: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "SELECT (COUNT(?run) AS ?runs) { ?run a robovast:TestExecution }"
    Path("own.rq").write_text(text)
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    assert vast("results", "sparql", "own.rq", "-o", "csv").out == "runs\n4\n"
    assert vast("results", "sparql", "-", "-o", "json").out == '[\n{"runs": 4}\n]\n'


def test_a_table_of_several_campaigns_names_them(
    vast, described: Path, caplog: pytest.LogCaptureFixture
) -> None:
    make_old_campaign(described, 1, 1, name="more-2026-01-01-000000")
    vast("results", "metadata")
    out = vast("results", "sparql", "failed-runs").out
    assert f"\n{NAME}/hall-1-2/0  failed" in out
    (described / NAME / "metadata.prov.json").unlink()
    vast("results", "sparql", "failed-runs")
    said = (
        f"{NAME}: skipped, because metadata.prov.json is missing; `vast results metadata` writes it"
    )
    assert said in caplog.text


def test_nothing_to_ask_says_what_to_do_once(
    vast, results: Path, caplog: pytest.LogCaptureFixture
) -> None:
    outcome = vast("results", "sparql", "failure-rate")
    assert outcome.code == 2
    assert "\nhint: run `vast results metadata` to write it\n" in outcome.err
    assert f"{caplog.text}{outcome.err}".count("metadata.prov.json") == 1


@pytest.mark.parametrize(
    ("query", "cause"),
    [
        ("failure-rat", "\nhint: did you mean `failure-rate`? A query"),
        ("latin.rq", "latin.rq: not a text file in UTF-8"),
        ("broken.rq", "the query is wrong"),
    ],
)
def test_a_query_that_cannot_be_asked(vast, described: Path, query: str, cause: str) -> None:
    Path("latin.rq").write_bytes(b"# \xe9\nSELECT * {}")
    Path("broken.rq").write_text("SELECT ?x WHERE {")
    outcome = vast("results", "sparql", query)
    assert (outcome.code, outcome.out) == (2, "")
    assert cause in outcome.err


def test_a_graph_that_is_damaged_is_named(vast, described: Path) -> None:
    (described / NAME / "metadata.prov.json").write_text('{"@context": {')
    outcome = vast("results", "sparql", "failure-rate")
    assert outcome.code == 2
    assert f"results/{NAME}/metadata.prov.json: cannot be read" in outcome.err
