from __future__ import annotations

import json
import math
import os
import re
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import duckdb
import pytest
from support.campaigns.finished import NAME, as_of_another_tool, finished_campaign

from robovast.analysis.tables.campaign_store import write_campaign_store
from robovast.analysis.tables.columnar import update_columnar
from robovast.analysis.tables.query import ask, tables
from robovast.analysis.tables.query_errors import explain_error
from robovast.analysis.tables.sqlite_tables import update_sqlite
from robovast.analysis.tables.staging import wider
from robovast.base.errors import InputError, StorageError, with_hint
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.layout import Layout


def update(campaign: Path, **versions: str) -> None:
    layout = Layout(campaign)
    runs = {f"{run.parent.name}/{run.name}": "1" for run in layout.run_folders()}
    runs.update({name.replace("_", "-", 1).replace("_", "/"): v for name, v in versions.items()})
    update_columnar(layout, runs)
    update_sqlite(layout, runs)


def rows(campaign: Path, sql: str) -> list[tuple[Any, ...]]:
    return ask([campaign], sql).rows


def sqlite_rows(campaign: Path, sql: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(campaign / "_execution/data.db")) as connection:
        return connection.execute(sql).fetchall()


def test_every_run_has_a_row_with_parameters_verdict_times_and_metrics(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    for run, score in (("c-1/0", "0.5"), ("c-2/0", "2")):
        (campaign / run / "metrics.csv").write_text(f"score,note\n{score},fine\n")
    update(campaign)
    answer = ask([campaign], "SELECT * FROM runs ORDER BY id")
    row = dict(zip(answer.columns, answer.rows[0], strict=True))
    assert (row["campaign"], row["config"], row["run"]) == (NAME, "c-1", 0)
    assert (row["verdict"], row["duration"], row["param_x"]) == ("passed", 2.0, 0)
    assert row["param_text"] == "a, b"
    assert (row["metrics_score"], row["metrics_note"]) == (0.5, "fine")
    assert str(row["started_at"]) == "2026-01-01 00:00:00"
    assert [row[-1] for row in rows(campaign, "SELECT metrics_score FROM runs ORDER BY id")] == [
        0.5,
        None,
        2.0,
    ]


def test_a_csv_name_is_one_table_whatever_is_in_the_cells(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    one, two = campaign / "c-1/0/t.csv", campaign / "c-1/1/t.csv"
    one.write_text('n,x,text\n1,nan,"a, b"\n2,inf,"c\nd"\n')
    two.write_text("n,y\n3,true\n")
    update(campaign)
    found = rows(campaign, "SELECT run, n, x, text, y FROM t ORDER BY n")
    assert math.isnan(found[0][2])
    assert found[0][3:] == ("a, b", None)
    assert found[1] == (0, 2, math.inf, "c\nd", None)
    assert found[2] == (1, 3, None, None, True)
    assert sqlite_rows(campaign, "SELECT config, run, n, text FROM t ORDER BY n") == [
        ("c-1", 0, 1, "a, b"),
        ("c-1", 0, 2, "c\nd"),
        ("c-1", 1, 3, None),
    ]


@pytest.mark.parametrize("size", [1, 20_000])
def test_damaged_files_small_and_large(tmp_path: Path, size: int) -> None:
    campaign = finished_campaign(tmp_path, 2)
    (campaign / "c-1/0/t.csv").write_bytes(b"a,b\n" + b"1,2\n" * size + b"\xff,3,4\n5")
    (campaign / "c-1/1/t.csv").write_bytes(b"")
    update(campaign)
    counts = "SELECT count(*), count(b), max(b) FROM t"
    assert rows(campaign, counts) == [(size + 2, size + 1, 3)]
    assert sqlite_rows(campaign, counts) == [(size + 2, size + 1, 3)]


def test_only_changed_runs_are_read_again(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    update(campaign)
    for run, text in (("c-1/0", "v\n70\n"), ("c-1/1", "v\n71\n")):
        (campaign / run / "out.csv").write_text(text)
    update(campaign, c_1_0="2")
    expected = [("c-1", 0, 70), ("c-1", 1, 1), ("c-2", 0, 2)]
    assert rows(campaign, "SELECT config, run, v FROM out ORDER BY config, run") == expected
    query = "SELECT config, run, v FROM out ORDER BY config, run"
    assert sqlite_rows(campaign, query) == expected


def test_columns_get_wider_and_runs_disappear(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    update(campaign)
    (campaign / "c-1/1/out.csv").write_text("v,w\nfast,1.5\n")
    update(campaign, c_1_1="2")
    assert rows(campaign, "SELECT v, w FROM out ORDER BY run") == [("0", None), ("fast", 1.5)]
    for path in sorted((campaign / "c-1/0").iterdir()):
        path.unlink()
    (campaign / "c-1/0").rmdir()
    update(campaign, c_1_1="2")
    assert rows(campaign, "SELECT v FROM out") == [("fast",)]
    assert rows(campaign, "SELECT count(*) FROM runs") == [(1,)]


@pytest.mark.parametrize(
    ("one", "other", "both"),
    [
        ("BIGINT", "BIGINT", "BIGINT"),
        ("BIGINT", "DOUBLE", "DOUBLE"),
        ("DOUBLE", "BOOLEAN", "VARCHAR"),
        ("BOOLEAN", "VARCHAR", "VARCHAR"),
    ],
)
def test_wider_types(one: str, other: str, both: str) -> None:
    assert wider(one, other) == wider(other, one) == both


def test_runs_of_another_tool_are_told_by_test_xml_and_configurations(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    as_of_another_tool(campaign)
    (campaign / "c-1/1/test.xml").unlink()
    update(campaign)
    found = rows(
        campaign, "SELECT verdict, entry, param_x, duration, reason FROM runs ORDER BY run"
    )
    assert found[0] == ("passed", "c", 0, 1.5, None)
    assert found[1] == ("errored", "c", 0, None, "the run wrote no test.xml")


def test_all_campaigns_are_asked_at_once(tmp_path: Path) -> None:
    names = ("it's one-2026-01-01-000000", "two words-2026-01-01-000000")
    campaigns = [finished_campaign(tmp_path, 1, name=name) for name in names]
    (campaigns[1] / "c-1/0/more.csv").write_text("a\n1\n")
    (campaigns[1] / "c-1/0/out.csv").write_text("v,w\nx,1\n")
    for campaign in campaigns:
        update(campaign)
    unfinished = finished_campaign(tmp_path, 1, name="three-2026-01-01-000000")
    everything = [*campaigns, unfinished]
    found = ask(everything, "SELECT campaign, v, w FROM out ORDER BY campaign")
    assert found.rows == [(names[0], "0", None), (names[1], "x", 1)]
    assert list(tables(everything)["more"]) == ["campaign", "config", "run", "a"]


@pytest.mark.parametrize(
    ("sql", "message"),
    [
        ("  -- nothing", "the query is empty."),
        ("SELECT * FORM runs", 'DuckDB reports: syntax error at or near "runs".'),
        ("SELECT 'abc FROM runs", "DuckDB reports: unterminated string literal."),
        ("SELECT * FROM indexes", "there is no table `indexes`. Use one of out, runs."),
        ("SELECT * FROM rns", "there is no table `rns`. Did you mean `runs`?"),
        ("SELECT verdct FROM runs", "there is no column `verdct`. Did you mean `verdict`?"),
        ("SELECT r.verdct FROM runs r", "there is no column `verdct`. Did you mean `verdict`?"),
        ("SELECT * EXCLUDE (verdct) FROM runs", "Did you mean `verdict`?"),
        ("SELECT memory.main.runs.verdct FROM runs", "no column `verdct`"),
        ("SELECT run FROM runs WHERE verdict = passed", "Put text into single quotes."),
        ("SELECT * FROM runs JOIN out USING (cnfig)", "Did you mean `config`?"),
        ("SELECT q.run FROM runs r", 'DuckDB reports: Referenced table "q" not found.'),
        (
            "SELECT config FROM runs, out",
            'DuckDB reports: Ambiguous reference to column name "config"',
        ),
        ("SELECT sum(verdict) FROM runs", "argument types 'sum(VARCHAR)'."),
        ("SELECT verdict, count(*) FROM runs", "Write GROUP BY verdict, or"),
        ("SELECT * FROM runs WHERE run = 'abc'", "`abc` cannot be converted to INT32."),
        ("SELECT * FROM runs WHERE verdict=7", "`verdict` is text, and `passed` cannot be"),
        (
            "SELECT * FROM runs r WHERE r.verdict IN (7, 8)",
            "is compared with text in single quotes",
        ),
        ("SELECT verdict::INT FROM runs", "cannot be converted to INT32."),
        ("SELECT * FROM runs WHERE verdict > 7.5", "Put the number into single quotes"),
        ("SELECT * FROM runs WHERE verdict BETWEEN 1 AND 2", "Put the number into single quotes"),
        ("SELECT 1; SELECT 2", "a query is one statement; there are 2"),
        ("SELECT '\udcff'", "not text in UTF-8"),
        ("SELECT 1 -- '\ud800'", "not text in UTF-8"),
        ("SELECT now()", "`now()::TIMESTAMP` for `now()`"),
        ("DELETE FROM runs", "a query can change nothing"),
        ("DROP TABLE runs", "a query can change nothing"),
        ("INSERT INTO campaign_0.out VALUES ('a', 1, 1)", "a query can change nothing"),
        ("SELECT * FROM read_csv('/etc/passwd')", "open no other file"),
        ("COPY (SELECT 1) TO '/tmp/robovast.csv'", "open no other file"),
        ("SET enable_external_access = true", "a query can change nothing"),
        ("CREATE TABLE x AS SELECT 1", "a query can change nothing"),
        ("CREATE TABLE x AS PIVOT runs ON verdict", "a query can change nothing"),
        ("EXPLAIN (ANALYZE) DROP VIEW runs", "a query can change nothing"),
        ("BEGIN", "a query can change nothing"),
        ("ATTACH ':memory:' AS more", "a query can change nothing"),
        ("PRAGMA database_list", "a query can change nothing"),
        ("CALL pragma_database_size()", "a query can change nothing"),
        ("SELECT run // 0 FROM runs", "DuckDB reports: Division by zero"),
        ("SELECT repeat('a', 10000000000)", "DuckDB reports: Cannot create a string of size"),
        ("SELECT timestamp 'x'", 'DuckDB reports: invalid timestamp field format: "x"'),
        ("SELECT * FROM runs, runs", 'Ambiguous reference to table "runs" (duplicate alias "runs"'),
        ("SELECT regexp_matches(verdict, '(') FROM runs", "DuckDB reports: missing ): (."),
        ("SELECT nextval('x')", "DuckDB reports: Sequence with name x does not exist."),
        (f"SELECT {'(' * 2000}1{')' * 2000}", "DuckDB reports: Max expression depth limit"),
    ],
)
def test_queries_are_explained_and_can_change_nothing(
    tmp_path: Path, sql: str, message: str
) -> None:
    campaign = finished_campaign(tmp_path, 1)
    update(campaign)
    with pytest.raises(InputError) as error:
        ask([campaign], sql)
    first = error.value.message.partition("\n")[0]
    assert message in with_hint(first, error.value.hint)
    assert not re.search(r"Error:|\bSET\b|memory\.main|Please", str(error.value).partition("\n")[0])


@pytest.mark.parametrize(
    ("cause", "told"),
    [
        ('IO Error: Cannot open file "/home/me/a/b.duckdb": No such file', 'file "b.duckdb": No'),
        (
            "Binder Error: It is x. Use TRY(...), or SET a=false to go on.",
            "DuckDB reports: It is x.",
        ),
        ("Binder Error: It is y! Please add casts.\nCandidates", "DuckDB reports: It is y."),
    ],
)
def test_what_is_not_known_of_queries_is_told_without_paths_and_advice(
    cause: str, told: str
) -> None:
    assert told in str(explain_error(cause, "SELECT 1", {}))


@pytest.mark.parametrize(
    "sql",
    [
        *("PIVOT runs ON verdict", "DESCRIBE runs", "SUMMARIZE runs", "SHOW TABLES", "FROM runs"),
        *("VALUES (1)", "-- all\nWITH a AS (FROM runs) FROM a;", "EXPLAIN ANALYZE FROM runs"),
    ],
)
def test_every_kind_of_statement_that_reads_is_answered(tmp_path: Path, sql: str) -> None:
    campaign = finished_campaign(tmp_path, 1)
    update(campaign)
    assert rows(campaign, sql)


def test_the_place_of_a_fault_is_marked_in_its_line(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    update(campaign)
    with pytest.raises(InputError, match="duraton") as error:
        ask([campaign], "SELECT run FROM runs\nWHERE duraton > 3")
    line, mark = error.value.message.splitlines()[1:]
    assert (line, mark.rstrip("^")) == ("    WHERE duraton > 3", " " * 10)


def test_a_file_whose_name_is_no_utf_8_is_a_table_too(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    (campaign / "c-1/0/caf\udce9.csv").write_text("a\n1\n")
    update(campaign)
    assert sqlite_rows(campaign, "SELECT a FROM caf") == [(1,)]
    assert rows(campaign, "SELECT a FROM caf") == [(1,)]


@pytest.mark.parametrize(
    ("one", "other", "column"),
    [("a", "A", "x"), ("a_by_run", "a", "x"), ("ä", "Ä", "x"), ("t", "t", "ä"), ("t", "t", "X")],
)
def test_names_that_differ_in_letter_case_alone_spoil_no_table(
    tmp_path: Path, one: str, other: str, column: str
) -> None:
    campaign = finished_campaign(tmp_path, 2)
    (campaign / f"c-1/0/{one}.csv").write_text(f"{column}\n1\n")
    (campaign / f"c-1/1/{other}.csv").write_text(f"{column.swapcase()}\n2\n")
    (campaign / f"c-1/1/{one}.csv").write_text("y\n3\n")
    update(campaign)
    update(campaign, c_1_1="2")
    for found in (rows, sqlite_rows):
        assert found(campaign, f"SELECT {column} FROM {one} WHERE run = 0") == [(1,)]  # noqa: S608
        if one != other:
            wanted = f"SELECT {column.swapcase()} FROM {other} WHERE run = 1"  # noqa: S608
            assert (2,) in found(campaign, wanted)


def test_a_table_that_is_too_wide_for_sqlite_has_its_first_columns(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    columns = [f"c{number}" for number in range(2100)]
    (campaign / "c-1/0/t.csv").write_text(f"{','.join(columns)}\n{'7,' * 2099}7\n")
    update_sqlite(Layout(campaign), {"c-1/0": "1"})
    assert sqlite_rows(campaign, "SELECT c0, c1800 FROM t") == [(7, 7)]


def test_wide_tables_have_types_in_all_columns(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    header = ",".join(f"c{number}" for number in range(130))
    (campaign / "c-1/0/t.csv").write_text(f"{header}\n{'7,' * 128}1.5,x\n")
    update(campaign)
    assert rows(campaign, "SELECT c0, c100, c128, c129 FROM t") == [(7, 7, 1.5, "x")]


def test_without_tables_the_remedy_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="vast results postprocess"):
        ask([finished_campaign(tmp_path, 1)], "SELECT 1")


def test_damaged_tables_are_made_anew_and_those_in_use_are_left(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    for name in ("tables.duckdb", "data.db"):
        (campaign / "_execution" / name).write_bytes(b"damaged" * 1000)
    update(campaign)
    assert rows(campaign, "SELECT v FROM out") == [(0,)]
    assert sqlite_rows(campaign, "SELECT v FROM out") == [(0,)]
    for path in (campaign / "_execution").iterdir():
        path.unlink()
    (campaign / "_execution/tables.duckdb").mkdir()
    with pytest.raises(StorageError, match=r"tables\.duckdb"):
        update(campaign)


def test_nobody_waits_for_a_pipe_in_the_place_of_tables(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    os.mkfifo(campaign / "_execution" / "tables.duckdb")
    with pytest.raises(InputError, match="vast results postprocess"):
        ask([campaign], "SELECT 1")
    update_columnar(Layout(campaign), {"c-1/0": "1"})
    assert rows(campaign, "SELECT v FROM out") == [(0,)]


def test_the_campaign_store_has_a_unit_for_each_configuration(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 3)
    (campaign / "c-1/1/run.json").unlink()
    (campaign / "c-1/1/test.xml").unlink()
    layout = Layout(campaign)
    document = campaign / "_config/c.vast"
    for _ in range(2):
        write_campaign_store(layout, document, ["c-1/0", "c-1/1", "c-2/0"])
    with closing(sqlite3.connect(campaign / "campaign.db")) as connection:
        assert connection.execute("SELECT name, mode, batches FROM campaign").fetchall() == [
            (NAME, "batch", 1)
        ]
        assert connection.execute(
            "SELECT config_name, params_json, n_samples, status, result_dir FROM unit"
        ).fetchall() == [
            ("c-1", '{"x": 0, "text": "a, b"}', 2, "errored", "c-1"),
            ("c-2", '{"x": 2, "text": "a, b"}', 1, "passed", "c-2"),
        ]
        assert connection.execute("PRAGMA user_version").fetchone() == (1,)
        times = "SELECT created_at FROM campaign UNION ALL SELECT created_at FROM batch"
        assert connection.execute(times).fetchall() == [(1767225600.0,)] * 2, "2026-01-01, UTC"


def test_a_store_that_something_else_wrote_is_left_alone(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    with closing(sqlite3.connect(campaign / "campaign.db")) as connection, connection:
        connection.execute("CREATE TABLE campaign (id)")
    before = (campaign / "campaign.db").read_bytes()
    write_campaign_store(Layout(campaign), None, ["c-1/0"])
    assert (campaign / "campaign.db").read_bytes() == before


def hostile(campaign: Path, *statements: str) -> Path:
    """Tables that somebody made by hand; they know of a file that is none of the campaign's."""
    secret = campaign.parent / "secret.csv"
    secret.write_text("TOP-SECRET-HEADER\nsecret\n")
    path = campaign / "_execution" / "tables.duckdb"
    path.parent.mkdir(exist_ok=True)
    with closing(duckdb.connect(str(path))) as connection:
        for statement in statements:
            connection.execute(statement.replace("SECRET", f"read_csv('{secret}')"))
    return path


RECORDS = "CREATE TABLE run_records (config VARCHAR, run INTEGER, verdict VARCHAR)"


@pytest.mark.parametrize("view", ["other", "runs", "loaded", "metrics"])
def test_views_of_a_file_that_came_from_elsewhere_are_not_executed(
    tmp_path: Path, view: str
) -> None:
    campaign = finished_campaign(tmp_path, 1)
    hostile(campaign, RECORDS, f"CREATE VIEW {view} AS FROM SECRET")
    found = tables([campaign])
    assert found == {
        "runs": dict.fromkeys(("campaign", "config"), "VARCHAR")
        | {"run": "INTEGER", "verdict": "VARCHAR"}
    }
    assert rows(campaign, "SELECT * FROM runs") == []
    for sql in (f"FROM campaign_0.{view}", f"FROM '{tmp_path}/secret.csv'"):
        with pytest.raises(InputError, match="wrong"):
            ask([campaign], sql)


@pytest.mark.parametrize("view", ["loaded", "t"])
def test_tables_that_came_from_elsewhere_are_made_anew_without_executing_them(
    tmp_path: Path, view: str
) -> None:
    campaign = finished_campaign(tmp_path, 2)
    (campaign / "c-1/0/t.csv").write_text("n\n1\n")
    hostile(campaign, f"CREATE VIEW {view} AS FROM SECRET")
    update(campaign)
    assert rows(campaign, "SELECT n FROM t") == [(1,)]
    assert rows(campaign, "SELECT count(*) FROM runs") == [(2,)]


@pytest.mark.parametrize(
    "statements",
    [
        ("CREATE TABLE run_records (config VARCHAR)", "CREATE TABLE m (config VARCHAR, run INT)"),
        (RECORDS, "CREATE TABLE m (score DOUBLE)"),
    ],
)
def test_tables_that_do_not_fit_are_named(tmp_path: Path, statements: tuple[str, ...]) -> None:
    campaign = finished_campaign(tmp_path, 1)
    hostile(campaign, *statements)
    with pytest.raises(StorageError, match=r"tables\.duckdb: cannot be read"):
        ask([campaign], "SELECT 1")


def test_tables_of_older_versions_have_their_metrics(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    (campaign / "c-1/0/metrics.csv").write_text("score\n0.5\n")
    (campaign / "c-1/0/path.csv").write_text("x\n1\n2\n")
    update(campaign)
    with closing(duckdb.connect(str(campaign / "_execution/tables.duckdb"))) as connection:
        for table in ("metrics", "path", "run_records"):
            connection.execute(f"COMMENT ON TABLE {table} IS NULL")
    answer = ask([campaign], "SELECT * FROM runs")
    assert "metrics_score" in answer.columns
    assert "path_x" not in answer.columns


def test_the_rows_of_sqlite_are_found_by_either_name_of_a_run(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    (campaign / "c-1/1/logs").mkdir()
    (campaign / "c-1/1/logs/a b.csv").write_text("run_id,x\nown,1.5\n")
    update(campaign)
    found = sqlite_rows(campaign, "SELECT config_name, run_id, run_id_2, x FROM logs_a_b")
    assert found == [("c-1", "1", "own", 1.5)]
    assert sqlite_rows(campaign, "SELECT config, run FROM logs_a_b WHERE run_id = '1'") == [
        ("c-1", 1)
    ]
    columns = sqlite_rows(campaign, "SELECT name FROM pragma_table_info('out')")
    assert columns == [("config_name",), ("run_id",), ("v",)]
    names = sqlite_rows(campaign, "SELECT display_name, sql_name FROM _table_name_map ORDER BY 1")
    assert names == [("logs/a b", "logs_a_b"), ("out", "out")]


def test_sqlite_has_the_times_of_every_run(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    update(campaign)
    update(campaign, c_1_0="another")
    columns = sqlite_rows(
        campaign, "SELECT name, type FROM pragma_table_info('scenario_timestamps')"
    )
    names = ("config_name", "run_id", "timestamp", "status", "message")
    assert columns == [(name, "TEXT") for name in names]
    times = "SELECT * FROM scenario_timestamps WHERE run_id = '0' ORDER BY timestamp"
    assert sqlite_rows(campaign, times) == [
        ("c-1", "0", "1767225600.000000", "started", ""),
        ("c-1", "0", "1767225602.000000", "passed", ""),
    ]


def test_a_sqlite_file_of_another_version_is_made_anew(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    with closing(sqlite3.connect(campaign / "_execution/data.db")) as connection:
        connection.executescript(
            "CREATE TABLE _loaded (path PRIMARY KEY, version);"
            "INSERT INTO _loaded VALUES ('c-1/0', 1);"
            "CREATE TABLE out (config TEXT, run INTEGER, v NUMERIC);"
        )
    update(campaign)
    assert sqlite_rows(campaign, "SELECT config_name, v FROM out") == [("c-1", 0)]


def test_what_was_varied_has_columns_where_it_is_stated(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    update(campaign)
    assert not [name for name in ask([campaign], "FROM runs").columns if "factor_" in name]
    path = campaign / "_transient" / "configurations.yaml"
    listed = parse_yaml(path.read_text())
    listed["configs"][0]["_factors"] = {"clutter": {"value": 0.25, "unit": "1/m"}}
    path.write_text(dump_yaml(listed))
    update(campaign, c_1_0="2", c_1_1="2")
    assert rows(campaign, "SELECT DISTINCT factor_clutter FROM runs") == [(0.25,)]


def test_names_that_are_alike_in_sql_have_columns_of_their_own(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    path = campaign / "_transient" / "configurations.yaml"
    listed = parse_yaml(path.read_text())
    odd = {"Width": 1, "width": 2, 'a"b\nc': 3}
    listed["configs"][0]["_factors"] = {name: {"value": value} for name, value in odd.items()}
    path.write_text(dump_yaml(listed))
    update(campaign)
    query = 'SELECT DISTINCT "factor_Width", factor_width_2, "factor_a\'b\nc" FROM runs'
    assert rows(campaign, query) == [(1, 2, 3)]


@pytest.mark.parametrize(
    "time", ["0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59", "0001-01-01T00:00:00", "x"]
)
@pytest.mark.parametrize("key", ["started_at", "finished_at"])
def test_a_time_that_no_calendar_has_is_no_time(tmp_path: Path, key: str, time: str) -> None:
    campaign = finished_campaign(tmp_path, 1)
    record = campaign / "c-1/0/run.json"
    record.write_text(json.dumps({**json.loads(record.read_text()), key: time}))
    layout = Layout(campaign)
    update_columnar(layout, {"c-1/0": "1"})
    update_sqlite(layout, {"c-1/0": "1"})
    write_campaign_store(layout, campaign / "_config/c.vast", ["c-1/0"])
    answer = ask([campaign], "SELECT started_at::VARCHAR, finished_at::VARCHAR FROM runs")
    found = answer.rows[0][("started_at", "finished_at").index(key)]
    assert found in {None, "0001-01-01 00:00:00"}


def test_more_parameters_than_a_table_has_columns_are_one(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 1)
    record = campaign / "c-1/0/run.json"
    many = {f"p{number}": number for number in range(20_000)}
    record.write_text(json.dumps({**json.loads(record.read_text()), "parameters": many}))
    update_columnar(Layout(campaign), {"c-1/0": "1"})
    ((found,),) = ask([campaign], "SELECT param_json FROM runs").rows
    assert json.loads(found) == many
