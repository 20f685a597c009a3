"""What the tables of a campaign say of each run: a number for every column of every CSV file.

Read from `_execution/data.db`, which `vast results postprocess` writes: a table for each CSV name,
whose columns `config` and `run` say which run a row is of. It is only read, and not trusted.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from math import isfinite
from pathlib import Path

from robovast.errors import InputError
from robovast.evaluation.inside import MissingError, resolved

AGGREGATES = {"mean": "avg", "least": "min", "most": "max", "sum": "sum"}
"""What can be made of a run's values, and SQLite's name of it."""
MOST_COLUMNS = 400
PATIENCE = 30.0
"""How long one question may take [s]."""

_KEYS = ("config", "run")
_STEPS = 100_000
"""Virtual machine instructions between two looks at the clock."""


def metric_columns(results: Path, campaign: str) -> dict[str, list[str]]:
    """Columns with numbers by table; empty when the campaign was not postprocessed.

    Raises:
        InputError: the tables cannot be read.
    """
    try:
        with _opened(results, campaign) as connection:
            tables = _tables(connection)
            return {table: _numeric(connection, table, tables[table]) for table in tables}
    except MissingError:
        return {}


def metric(
    results: Path, campaign: str, table: str, column: str, aggregate: str
) -> dict[str, float]:
    """A number for every run, `<variant>/<number>`, that has any in the column.

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
        raise InputError(f"{aggregate!r} is none of {', '.join(AGGREGATES)}.")
    with _opened(results, campaign) as connection:
        if column not in _tables(connection).get(table, ()):
            raise MissingError(f"There is no column {column} in a table {table}.")
        name = _quoted(column)
        rows = connection.execute(
            f"SELECT config, run, {AGGREGATES[aggregate]}({name}) FROM {_quoted(table)} "  # noqa: S608
            f"WHERE typeof({name}) IN ('integer', 'real') GROUP BY config, run"
        )
        return {f"{v}/{run}": n for v, run, n in rows if n is not None and isfinite(n)}


@contextmanager
def _opened(results: Path, campaign: str) -> Iterator[sqlite3.Connection]:
    relative = f"{campaign}/_execution/data.db"
    path = resolved(results, relative)
    if not path.is_file():
        raise MissingError(f"{relative} is no file.")
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
            _restrict(connection)
            yield connection
    except (sqlite3.Error, OverflowError) as error:
        raise InputError(f"{relative} cannot be read: {error}.") from None


def _restrict(connection: sqlite3.Connection) -> None:
    """Make neither its own definitions nor its size a danger."""
    end = time.monotonic() + PATIENCE
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    connection.set_progress_handler(lambda: time.monotonic() > end, _STEPS)


def _tables(connection: sqlite3.Connection) -> dict[str, list[str]]:
    """Columns of the tables that have rows of runs; virtual tables and views are none."""
    found: dict[str, list[str]] = {}
    rows = connection.execute(
        "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c "
        "WHERE m.type = 'table' AND m.sql LIKE 'CREATE TABLE%' LIMIT 100000"
    )
    for table, column in rows:
        found.setdefault(table, []).append(column)
    return {table: names for table, names in found.items() if set(_KEYS) <= set(names)}


def _numeric(connection: sqlite3.Connection, table: str, columns: list[str]) -> list[str]:
    """Columns whose first value is a number."""
    found = []
    for name in [name for name in columns if name not in _KEYS][:MOST_COLUMNS]:
        kind = connection.execute(
            f"SELECT typeof({_quoted(name)}) FROM {_quoted(table)} "  # noqa: S608
            f"WHERE {_quoted(name)} IS NOT NULL LIMIT 1"
        ).fetchone()
        if kind and kind[0] in ("integer", "real"):
            found.append(name)
    return found


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
