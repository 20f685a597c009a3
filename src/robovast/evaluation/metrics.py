"""Metrics of a campaign: one number per run for each column of each CSV file.

They are read from `_execution/data.db` of `vast results postprocess`, which has a table for each
CSV name with the columns `config` and `run`. The file is read-only and not trusted.
"""

from __future__ import annotations

import sqlite3
from contextlib import AbstractContextManager
from math import isfinite
from pathlib import Path

from robovast.base.errors import InputError
from robovast.base.sqlite_files import opened
from robovast.campaign.layout import SQLITE_TABLES
from robovast.evaluation.confined_files import MissingError, resolved

AGGREGATES = {"mean": "avg", "least": "min", "most": "max", "sum": "sum"}
"""Aggregate functions, and their names in SQLite."""
MOST_COLUMNS = 400
_GLANCE = 1000
"""Rows in which a column usually has two values, unless it has one everywhere."""

_KEYS = {"config", "run"}
_NAMES = {"config_name", "run_id", *_KEYS}


def metric_columns(results: Path, campaign: str) -> dict[str, list[str]]:
    """Numeric columns by table; empty if the campaign was not postprocessed.

    Raises:
        InputError: the tables cannot be read.
    """
    try:
        with _opened(results, campaign) as connection:
            tables = _tables(connection)
            return {table: _numeric(connection, table, tables[table]) for table in tables}
    except MissingError:
        return {}


def constant_columns(results: Path, campaign: str) -> dict[str, list[str]]:
    """Those of the numeric columns, by table, that have one value everywhere.

    None of them if that takes too long to find out.
    """
    try:
        with _opened(results, campaign) as connection:
            tables = _tables(connection)
            found = {
                table: _constant(connection, table, _numeric(connection, table, tables[table]))
                for table in tables
            }
    except InputError:
        return {}
    return {table: names for table, names in found.items() if names}


def metric(
    results: Path, campaign: str, table: str, column: str, aggregate: str
) -> dict[str, float]:
    """One number per run, given as `<variant>/<number>`; runs without numbers are left out.

    Args:
        results: the results folder, without links.
        campaign: the campaign's folder in it.
        table: name of the table.
        column: name of the column.
        aggregate: a key of `AGGREGATES`.

    Raises:
        InputError: there is no such table, column or aggregate, or it takes too long.
    """
    if aggregate not in AGGREGATES:
        raise InputError(
            f"{aggregate!r} is not a valid aggregate", hint=f"use one of {', '.join(AGGREGATES)}"
        )
    with _opened(results, campaign) as connection:
        if column not in _tables(connection).get(table, ()):
            raise MissingError(
                f"There is no column {column} in a table {table}.",
                hint="use a numeric column of a table",
            )
        name = _quoted(column)
        rows = connection.execute(
            f"SELECT config, run, {AGGREGATES[aggregate]}({name}) FROM {_quoted(table)} "  # noqa: S608
            f"WHERE typeof({name}) IN ('integer', 'real') GROUP BY config, run"
        )
        return {f"{v}/{run}": n for v, run, n in rows if n is not None and isfinite(n)}


def _opened(results: Path, campaign: str) -> AbstractContextManager[sqlite3.Connection]:
    relative = f"{campaign}/{SQLITE_TABLES}"
    return opened(resolved(results, relative), relative)


def _tables(connection: sqlite3.Connection) -> dict[str, list[str]]:
    """Columns of the tables with rows of runs, without virtual tables and views."""
    found: dict[str, list[str]] = {}
    rows = connection.execute(
        "SELECT m.name, c.name FROM sqlite_master m, pragma_table_xinfo(m.name) c "
        "WHERE m.type = 'table' AND m.sql LIKE 'CREATE TABLE%' LIMIT 100000"
    )
    for table, column in rows:
        found.setdefault(table, []).append(column)
    return {table: names for table, names in found.items() if set(names) >= _KEYS}


def _numeric(connection: sqlite3.Connection, table: str, columns: list[str]) -> list[str]:
    """Columns whose first value is a number."""
    found = []
    for name in [name for name in columns if name not in _NAMES][:MOST_COLUMNS]:
        kind = connection.execute(
            f"SELECT typeof({_quoted(name)}) FROM {_quoted(table)} "  # noqa: S608
            f"WHERE {_quoted(name)} IS NOT NULL LIMIT 1"
        ).fetchone()
        if kind and kind[0] in ("integer", "real"):
            found.append(name)
    return found


def _constant(connection: sqlite3.Connection, table: str, columns: list[str]) -> list[str]:
    """Columns without two values; most of the others show two in the first rows."""
    for rows in (_GLANCE, -1):  # -1: all
        if columns:
            names = [_quoted(name) for name in columns]
            source = f"(SELECT {', '.join(names)} FROM {_quoted(table)} LIMIT {rows})"  # noqa: S608
            tests = ", ".join(f"min({name}) IS max({name})" for name in names)
            one = connection.execute(f"SELECT {tests} FROM {source}").fetchone()  # noqa: S608
            columns = [name for name, is_one in zip(columns, one, strict=True) if is_one]
    return columns


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
