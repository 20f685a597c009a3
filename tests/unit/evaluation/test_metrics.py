"""Numbers of the runs come from the tables that postprocessing writes, whoever wrote these."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from robovast.analysis.tables.sqlite_tables import update_sqlite
from robovast.base import sqlite_files
from robovast.base.errors import InputError
from robovast.campaign.layout import Layout
from robovast.evaluation.metrics import constant_columns, metric, metric_columns


@pytest.fixture
def results(tmp_path: Path) -> Path:
    root = tmp_path / "hall"
    for run, text in {
        "a-1/0": "t,x,name\n0,1,p\n1,4,q\n2,,r\n",
        "a-1/1": "t,x,name\n0,-2,p\n",
        "a-2/0": "t,x,name\n0,nan,p\n",
    }.items():
        (root / run).mkdir(parents=True)
        (root / run / "poses.csv").write_text(text)
    update_sqlite(Layout(root), {"a-1/0": "1", "a-1/1": "1", "a-2/0": "1"})
    return tmp_path


def altered(results: Path, *statements: str) -> None:
    with closing(sqlite3.connect(results / "hall" / "_execution" / "data.db")) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()


def test_columns_with_numbers(results: Path) -> None:
    assert metric_columns(results, "hall") == {"poses": ["t", "x"]}


def test_columns_with_one_value_everywhere(results: Path) -> None:
    """Also where a second value is far below the first rows."""
    assert constant_columns(results, "hall") == {}
    for run in ("a-1/0", "a-2/0"):
        late = 2 if run == "a-2/0" else 1
        rows = "".join(f"7,1,{i},\n" for i in range(1500)) + f"7,{late},0,\n,1,0,\n"
        (results / "hall" / run / "wheel.csv").write_text(f"radius,gear,t,none\n{rows}")
    update_sqlite(Layout(results / "hall"), {"a-1/0": "2", "a-2/0": "2"})
    assert metric_columns(results, "hall")["wheel"] == ["radius", "gear", "t"]
    assert constant_columns(results, "hall") == {"wheel": ["radius"]}


@pytest.mark.parametrize(
    ("aggregate", "value"), [("mean", 2.5), ("least", 1), ("most", 4), ("sum", 5)]
)
def test_a_number_for_each_run_that_has_one(results: Path, aggregate: str, value: float) -> None:
    found = metric(results, "hall", "poses", "x", aggregate)
    assert found == {"a-1/0": value, "a-1/1": -2}


def test_tables_of_an_older_version_are_read(results: Path) -> None:
    altered(
        results,
        "DROP TABLE poses",
        "CREATE TABLE poses (config TEXT, run INTEGER, x NUMERIC)",
        "INSERT INTO poses VALUES ('a-1', 0, 3), ('a-1', 0, 5)",
    )
    assert metric_columns(results, "hall") == {"poses": ["x"]}
    assert metric(results, "hall", "poses", "x", "mean") == {"a-1/0": 4.0}


def test_a_campaign_without_tables_has_none(results: Path) -> None:
    (results / "hall" / "_execution" / "data.db").unlink()
    assert metric_columns(results, "hall") == {}


@pytest.mark.parametrize(
    ("table", "column"),
    [("poses", "none"), ("none", "x"), ("poses", 'x" FROM poses --'), ("sqlite_master", "sql")],
)
def test_only_columns_that_are_there(results: Path, table: str, column: str) -> None:
    with pytest.raises(InputError, match="There is no column"):
        metric(results, "hall", table, column, "mean")


def test_only_known_aggregates(results: Path) -> None:
    with pytest.raises(InputError, match=r"is not a valid aggregate\. Use one of mean"):
        metric(results, "hall", "poses", "x", "load_extension")


def test_names_are_quoted(results: Path) -> None:
    altered(
        results,
        'CREATE TABLE "a""b" (config, run, "x""); DROP TABLE poses; --")',
        'INSERT INTO "a""b" VALUES (\'a-1\', 0, 7)',
    )
    assert metric(results, "hall", 'a"b', 'x"); DROP TABLE poses; --', "mean") == {"a-1/0": 7}


def test_views_are_no_tables(results: Path) -> None:
    altered(
        results,
        "CREATE VIEW endless AS WITH RECURSIVE n(config, run, x) AS "
        "(SELECT 'a', 0, 1 UNION ALL SELECT config, run + 1, x FROM n) SELECT * FROM n",
    )
    assert list(metric_columns(results, "hall")) == ["poses"]


def test_a_question_that_takes_too_long_ends(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_files, "TIME_LIMIT", 0)
    monkeypatch.setattr(sqlite_files, "_STEPS", 10)
    with pytest.raises(InputError, match="interrupted"):
        metric(results, "hall", "poses", "x", "mean")


@pytest.mark.parametrize("content", [b"no database at all", b"SQLite format 3\0" + b"\xff" * 4000])
def test_a_damaged_file_is_an_error_in_words(results: Path, content: bytes) -> None:
    (results / "hall" / "_execution" / "data.db").write_bytes(content)
    with pytest.raises(InputError, match="cannot be read"):
        metric_columns(results, "hall")


def test_a_link_to_another_database_is_not_followed(results: Path, tmp_path: Path) -> None:
    inside = results / "inside"
    inside.mkdir()
    (inside / "hall" / "_execution").mkdir(parents=True)
    (inside / "hall" / "_execution" / "data.db").symlink_to(results / "hall/_execution/data.db")
    with pytest.raises(InputError, match="leads out"):
        metric_columns(inside, "hall")
