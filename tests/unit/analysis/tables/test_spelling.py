"""A cell is a number only if the number can give back the cell as it is written."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import duckdb
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.campaigns.finished import finished_campaign

from robovast.analysis.tables.columnar import update_columnar
from robovast.analysis.tables.query import ask, tables
from robovast.analysis.tables.spelling import is_double, is_whole, number_in
from robovast.analysis.tables.sqlite_tables import update_sqlite
from robovast.analysis.tables.staging import append, quoted
from robovast.campaign.layout import Layout
from robovast.evaluation.tables import read_table

CASES = Path(__file__).parents[3] / "data/cases"
TEXTS = [
    *("1_1", "2_10", "0012", "007", "1.10", "5e10293", "+5", " 5", "5 ", "1e5", "1E5", "1e-3"),
    *("0x1A", "0b11", "1.", ".5", "--1", "1e400", "1e-400", "Infinity", "NAN", "1,5", "12:30"),
    *("12.345678901234567890e0", "9007199254740993.0", "1.50", "01.5", "-", "e5", "\u0661", "1e+5"),
    *("2024-01-01", "1\n", "00", "-007", "1d", "1f", "true"),
]
NUMBERS = [
    *("0", "-0", "12", "-5", "1700000000123456789", "18446744073709551615", "0.1", "3.0", "-0.0"),
    *("1e-05", "1E-5", "1.0E-5", "1e+16", "1e+06", "nan", "NaN", "inf", "-inf", "5e-324"),
    *("0.30000000000000004", "0.10000000000000001", "1.000000000000000000e+00", "1.500000e+03"),
    *("1.7976931348623157e+308", "0.000001", "9007199254740993", "1.500000", "0.100", "100.000"),
]
CELLS = st.one_of(
    st.sampled_from(TEXTS + NUMBERS),
    st.from_regex(r"[-+]?[0-9_]{1,4}(\.[0-9]{0,4})?([eE][-+]?[0-9]{1,3})?", fullmatch=True),
    st.text(alphabet="0123456789.eE+-_nainf ", max_size=8),
    st.floats().map(repr),
    st.floats().map("{:.17g}".format),
    st.floats(-1e6, 1e6).map("{:.3f}".format),
    st.integers().map(str),
)


@pytest.fixture(scope="module")
def connection() -> duckdb.DuckDBPyConnection:
    return duckdb.connect()


def column(connection: duckdb.DuckDBPyConnection, *batches: Sequence[str]) -> list[Any]:
    """The cells of one column as the table has them, appended batch by batch."""
    connection.execute("DROP TABLE IF EXISTS t")
    for cells in batches:
        connection.execute("CREATE OR REPLACE TEMP TABLE staged (place VARCHAR, x VARCHAR)")
        connection.executemany(
            "INSERT INTO staged VALUES (?, ?)", [(str(n), cell) for n, cell in enumerate(cells)]
        )
        append(connection, "t", ["place", "x"], {"place": "INTEGER"})
    return [x for (x,) in connection.execute("SELECT x FROM t ORDER BY rowid").fetchall()]


@pytest.mark.parametrize("cell", TEXTS)
def test_text_that_looks_like_a_number_stays_text(
    connection: duckdb.DuckDBPyConnection, cell: str
) -> None:
    assert number_in(cell) is None
    assert column(connection, [cell]) == [cell if cell != "true" else True]
    assert column(connection, ["1", cell, "2.5"]) == ["1", cell, "2.5"]


@pytest.mark.parametrize("cell", NUMBERS)
def test_numbers_as_programs_write_them_are_numbers(
    connection: duckdb.DuckDBPyConnection, cell: str
) -> None:
    (found,) = column(connection, [cell])
    assert not isinstance(found, str)
    assert repr(float(found)) == repr(float(cell))
    assert number_in(cell) is not None
    assert Decimal(str(found)) == Decimal(cell) or float(found) == float(cell) or found != found


@given(st.lists(CELLS, min_size=1, max_size=6))
def test_different_cells_stay_different_values(
    connection: duckdb.DuckDBPyConnection, cells: list[str]
) -> None:
    found = column(connection, cells)
    if isinstance(found[0], str):
        assert found == cells
    else:
        assert len(set(cells)) == len({str(value) for value in found})
        for cell, value in zip(cells, found, strict=True):
            if isinstance(value, int | Decimal) and not isinstance(value, bool):
                assert str(value) == cell
            elif isinstance(value, float):
                assert repr(value) == repr(float(cell))


@given(CELLS)
def test_the_rule_is_one_in_sql_and_python(
    connection: duckdb.DuckDBPyConnection, cell: str
) -> None:
    row = connection.execute(
        f"SELECT {is_whole('x')}, {is_double('x')} FROM (SELECT ?::VARCHAR AS x)",  # noqa: S608
        [cell],
    ).fetchone()
    assert row is not None
    number = number_in(cell)
    if row[0]:
        assert number == int(cell)
    elif row[1]:
        assert isinstance(number, float)
        assert repr(number) == repr(float(cell))
    else:  # a column with fixed decimals decides for all of its cells
        assert number is None or "." in cell or abs(number) >= 2**127


@given(st.lists(st.lists(CELLS, min_size=1, max_size=3), min_size=1, max_size=4))
@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
def test_runs_that_arrive_later_change_no_cell(tmp_path: Path, runs: list[list[str]]) -> None:
    shutil.rmtree(tmp_path / "all", ignore_errors=True)
    campaign = finished_campaign(tmp_path / "all", len(runs))
    layout = Layout(campaign)
    versions: dict[str, str] = {}
    for run, cells in zip(layout.run_folders(), runs, strict=True):
        with (run / "x.csv").open("w", newline="") as file:
            csv.writer(file).writerows([["cell"], *([cell] for cell in cells)])
        versions[f"{run.parent.name}/{run.name}"] = "1"
        update_columnar(layout, versions)
    update_sqlite(layout, versions)
    written = sorted(cell for cells in runs for cell in cells if cell)
    found = [v for (v,) in ask([campaign], "SELECT cell FROM x").rows if v is not None]
    if tables([campaign])["x"]["cell"] == "VARCHAR":
        assert sorted(found) == written
    else:
        assert sorted(repr(float(v)) for v in found) == sorted(repr(float(c)) for c in written)


def test_whole_numbers_are_exact_when_fractions_arrive_later(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2)
    layout = Layout(campaign)
    cells = ("9007199254740993", "0.5")
    versions: dict[str, str] = {}
    for run, cell in zip(layout.run_folders(), cells, strict=True):
        (run / "x.csv").write_text(f"cell\n{cell}\n")
        versions[f"{run.parent.name}/{run.name}"] = "1"
        update_columnar(layout, versions)
    assert ask([campaign], "SELECT cell FROM x ORDER BY 1").rows == [(c,) for c in sorted(cells)]


@given(st.lists(CELLS.filter(str.strip), min_size=1, max_size=6))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_plotted_column_has_numbers_only_where_they_differ(
    tmp_path: Path, cells: list[str]
) -> None:
    with (tmp_path / "t.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["x"], *([cell] for cell in cells)])
    values = read_table(tmp_path, "t.csv", ["x"]).columns["x"]
    numbers = [value for value in values if isinstance(value, float)]
    if numbers:
        said = {c for c, value in zip(cells, values, strict=True) if value is not None}
        assert len(set(map(repr, numbers))) >= len(said) - 1  # -0 and 0 are one place
    else:
        assert all(value is None or value in cells for value in values)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("under", {"cell": ["1_1", "1_2", "2_10"]}),
        ("zeros", {"serial": ["0012", "0100"], "n": [1, 2]}),
        ("version", {"version": ["1.10", "1.9"]}),
        ("uint64", {"id": [18446744073709551615, 18446744073709551614]}),
        ("int64", {"stamp": [1700000000123456789, 1700000000123456788]}),
        ("hex", {"id": ["0x1A", "0x20"], "b": ["0b11", "0b01"]}),
        ("multi", {"a": [1, 2], "b": ["x\ny", "z"]}),
        ("spaces", {"t": [0, 1], "x": [" 1", " 2"]}),
    ],
)
def test_tables_of_the_cases(tmp_path: Path, name: str, expected: dict[str, list[Any]]) -> None:
    campaign = finished_campaign(tmp_path, 1)
    shutil.copy(CASES / "tables" / f"{name}.csv", campaign / "c-1/0")
    update_columnar(Layout(campaign), {"c-1/0": "1"})
    answer = ask([campaign], f"SELECT * EXCLUDE (campaign, config, run) FROM {name}")  # noqa: S608
    columns = zip(answer.columns, zip(*answer.rows, strict=True), strict=True)
    assert {column: list(values) for column, values in columns} == expected


def test_names_of_columns_are_quoted() -> None:
    assert is_double(quoted('a"b')).count('"a""b"') > 1
