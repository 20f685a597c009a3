"""Tables in a bucket may be older than this version, and may come from anyone."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import StorageError
from robovast.campaign.layout import COLUMNAR_TABLES
from robovast.campaign.run_record import COLUMNS
from robovast.campaign.verdict import Verdict
from robovast.evaluation.tabled_campaign import read_variants

duckdb = pytest.importorskip("duckdb")

NEWER = {"seed", "reused_from"}
"""Columns that older versions did not write."""


def write_tables(folder: Path, sql: str) -> Path:
    file = folder / COLUMNAR_TABLES
    file.parent.mkdir()
    with duckdb.connect(str(file)) as connection:
        connection.execute(sql)
    return folder


def table(values: dict[str, str], columns: set[str]) -> str:
    given = {"config": "'hall-1'", "run": "0", "verdict": "'failed'", **values}
    cells = (
        f"({given.pop(name, 'NULL')})::{kind} AS {name}"
        for name, kind in COLUMNS.items()
        if name in columns
    )
    parts = [*cells, *(f"{value} AS {name}" for name, value in given.items())]
    return f"CREATE TABLE runs AS SELECT {', '.join(parts)}"


def test_tables_of_older_versions_are_read(tmp_path: Path) -> None:
    folder = write_tables(tmp_path, table({"duration": "2.5"}, {*COLUMNS} - NEWER))
    (variant,) = read_variants(folder)
    (run,) = variant.runs
    assert (run.verdict, run.duration, run.seed, run.reused) == (Verdict.FAILED, 2.5, None, False)


@pytest.mark.parametrize("verdict", ["'great'", "NULL"])
def test_what_is_no_verdict_is_no_success(tmp_path: Path, verdict: str) -> None:
    (variant,) = read_variants(write_tables(tmp_path, table({"verdict": verdict}, {*COLUMNS})))
    assert [run.verdict for run in variant.runs] == [Verdict.ERRORED]


def test_parameters_of_any_kind_are_data(tmp_path: Path) -> None:
    given = {
        "param_deep": "repeat('[', 5000) || repeat(']', 5000)",
        "param_list": "'[1, 2]'",
        "param_time": "timestamp '2026-01-31 13:00:00'",
        "param_endless": "'inf'::DOUBLE",
    }
    (variant,) = read_variants(write_tables(tmp_path, table(given, {*COLUMNS})))
    assert variant.parameters == {
        "deep": "[" * 5000 + "]" * 5000,
        "list": [1, 2],
        "time": "2026-01-31T13:00:00",
        "endless": "inf",
    }


@pytest.mark.parametrize("sql", ["CREATE TABLE other AS SELECT 1", "CREATE TABLE runs AS SELECT 1"])
def test_tables_of_something_else_are_named_as_such(tmp_path: Path, sql: str) -> None:
    with pytest.raises(StorageError, match="the tables are not tables of a campaign"):
        read_variants(write_tables(tmp_path, sql))
