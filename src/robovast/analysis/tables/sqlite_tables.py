"""`_execution/data.db` (SQLite): one table per CSV name, with the rows of all runs.

Rows begin with the texts `config_name` and `run_id`, which users of the existing tool expect;
`config` and `run` (a number) have the same values. `_table_name_map` maps files to tables,
`scenario_timestamps` has start and end of each run.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from robovast.analysis.tables.csv_files import (
    KEYS,
    column_names,
    csv_files,
    folded,
    read_header,
    read_rows,
)
from robovast.analysis.tables.runs import run_rows
from robovast.analysis.tables.spelling import number_in
from robovast.analysis.tables.staging import quoted
from robovast.base.errors import StorageError
from robovast.campaign.layout import SQLITE_TABLES, Layout
from robovast.campaign.run_files import shown

_LOADED = "_loaded"
"""Table with the version of each run in the other tables."""
_NAMES = "_table_name_map"
_TIMES = "scenario_timestamps"
_FIRST = ("config_name", "run_id")
_RUN = "config_name = ? AND run_id = ?"
_MOST_COLUMNS = 1900
"""Most columns of a table; SQLite allows 2000. All columns are in tables.duckdb."""


def update_sqlite(layout: Layout, versions: Mapping[str, str]) -> None:
    """Update the tables.

    Cells that are numbers, as `number_in` has it, are stored as numbers, and empty cells as NULL.

    Args:
        layout: the campaign's layout.
        versions: version of each run, as `<variant>/<number>`; runs are read again if their version
            has changed.

    Raises:
        StorageError: the file cannot be written.
    """
    path = layout.root / SQLITE_TABLES
    try:
        layout.execution.mkdir(exist_ok=True)
        with closing(_connect(path)) as connection, connection:
            _update(connection, layout, versions)
    except (OSError, sqlite3.Error) as error:
        raise StorageError(f"{path}: cannot be written: {error}.") from error


def _connect(path: Path) -> sqlite3.Connection:
    """Open the file; a foreign one is recreated, since all its content is derived."""
    connection = sqlite3.connect(path)
    try:
        known = connection.execute("SELECT name FROM sqlite_master").fetchall()
    except sqlite3.DatabaseError:
        known = [("damaged",)]
    if known and not {(_LOADED,), (_NAMES,)} <= set(known):
        connection.close()
        path.unlink()
        connection = sqlite3.connect(path)
    connection.executescript(
        f"CREATE TABLE IF NOT EXISTS {_LOADED} (path PRIMARY KEY, version);"
        f"CREATE TABLE IF NOT EXISTS {_NAMES} (display_name TEXT, sql_name TEXT PRIMARY KEY);"
        f"CREATE TABLE IF NOT EXISTS {_TIMES} "
        "(config_name TEXT, run_id TEXT, timestamp TEXT, status TEXT, message TEXT);"
    )
    return connection


def _update(connection: sqlite3.Connection, layout: Layout, versions: Mapping[str, str]) -> None:
    loaded = dict(connection.execute(f"SELECT path, version FROM {_LOADED}"))  # noqa: S608
    stale = [run for run, version in versions.items() if loaded.get(run) != version]
    tables = _tables(connection)
    gone = [run for run in loaded if versions.get(run) != loaded[run]]
    _remove(connection, [*tables, _TIMES], gone)
    for run in stale:
        for table, path in csv_files(layout.run(run)).items():
            name = shown(path.relative_to(layout.run(run)).with_suffix("").as_posix())
            connection.execute(f"REPLACE INTO {_NAMES} VALUES (?, ?)", (name, table))  # noqa: S608
            _load(connection, tables.setdefault(folded(table), []), table, run, path)
    _add_times(connection, layout, stale)
    connection.executemany(
        f"REPLACE INTO {_LOADED} VALUES (?, ?)",  # noqa: S608
        ((run, versions[run]) for run in stale),
    )


def _tables(connection: sqlite3.Connection) -> dict[str, list[str]]:
    """Columns of every table, by lower-case name."""
    rows = connection.execute(
        "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c "
        "WHERE m.type = 'table' AND m.name NOT IN (?, ?, ?)",
        (_LOADED, _NAMES, _TIMES),
    )
    found: dict[str, list[str]] = {}
    for table, column in rows:
        found.setdefault(folded(table), []).append(column)
    return found


def _remove(connection: sqlite3.Connection, tables: Iterable[str], runs: Sequence[str]) -> None:
    keys = [_key(run) for run in runs]
    for table in tables if keys else ():
        connection.executemany(f"DELETE FROM {quoted(table)} WHERE {_RUN}", keys)  # noqa: S608
    connection.executemany(
        f"DELETE FROM {_LOADED} WHERE path = ?",  # noqa: S608
        ((run,) for run in runs),
    )


def _key(run: str) -> tuple[str, str]:
    """The variant's name, and the run's number."""
    variant, _, number = run.rpartition("/")
    return variant, number


def _add_times(connection: sqlite3.Connection, layout: Layout, runs: Sequence[str]) -> None:
    """Add start and end of runs, as far as they are known."""
    for run, row in zip(runs, run_rows(layout, runs), strict=True):
        events = [
            (row["started_at"], "started", ""),
            (row["finished_at"], row["verdict"], row["reason"] or ""),
        ]
        connection.executemany(
            f"INSERT INTO {_TIMES} VALUES (?, ?, ?, ?, ?)",  # noqa: S608
            ((*_key(run), _seconds(time), *said) for time, *said in events if time),
        )


def _seconds(time: str) -> str:
    """Convert a UTC time to seconds since the epoch."""
    return f"{datetime.fromisoformat(time).replace(tzinfo=UTC).timestamp():.6f}"


def _load(
    connection: sqlite3.Connection, have: list[str], table: str, run: str, path: Path
) -> None:
    columns = column_names(read_header(path), ("campaign", *KEYS, *_FIRST))
    if not columns:
        return
    for statement in _declared(have, table, columns):
        connection.execute(statement)
    stored = set(map(folded, have))
    cells = [index for index, name in enumerate(columns) if folded(name) in stored]
    names = ", ".join(map(quoted, [*_FIRST, *(columns[index] for index in cells)]))
    places = ", ".join("?" * (len(cells) + 2))
    rows = read_rows(path, len(columns))
    connection.executemany(
        f"INSERT INTO {quoted(table)} ({names}) VALUES ({places})",  # noqa: S608
        ([*_key(run), *(_cell(row[index]) for index in cells)] for row in rows),
    )


def _cell(text: str) -> int | float | str | None:
    """The value of a cell: its number if the number can give back the text, else the text."""
    number = number_in(text)
    if isinstance(number, int):
        return number if abs(number) < 2**63 else text
    is_number = number is not None and not math.isnan(number)  # which SQLite stores as NULL
    return number if is_number else text or None


def _declared(have: list[str], table: str, columns: Sequence[str]) -> Iterator[str]:
    """Statements that add missing columns to a table; also updates `have`.

    Columns have no type, since SQLite would convert `007` to 7.
    """
    known = set(map(folded, have))
    new = [name for name in columns if folded(name) not in known][
        : max(0, _MOST_COLUMNS - len(have))
    ]
    if not have:
        listed = ", ".join(map(quoted, new))
        yield (
            f"CREATE TABLE {quoted(table)} (config_name TEXT, run_id TEXT, {listed}, "
            "config TEXT AS (config_name), run INTEGER AS (CAST(run_id AS INTEGER)))"
        )
        yield f"CREATE INDEX {quoted(f'{table} by run')} ON {quoted(table)} (config_name, run_id)"
    else:
        yield from (f"ALTER TABLE {quoted(table)} ADD {quoted(name)}" for name in new)
    have += new
