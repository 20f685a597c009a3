"""`_execution/data.db` (SQLite): one table for each CSV name, with the rows of all runs."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

from robovast.analysis.tables.csv_files import KEYS, column_names, csv_files, read_header, read_rows
from robovast.analysis.tables.staging import quoted
from robovast.base.errors import StorageError
from robovast.campaign.layout import Layout

FILE = "data.db"
_LOADED = "_loaded"
"""Table that says which version of each run the others hold."""


def update_sqlite(layout: Layout, versions: Mapping[str, str]) -> None:
    """Bring the tables up to date.

    Numbers are stored as numbers, empty cells as NULL.

    Args:
        layout: of the campaign.
        versions: of every run, by `<variant>/<number>`: a run is read when its version is not the
            one of the last time.

    Raises:
        StorageError: the file cannot be written.
    """
    path = layout.execution / FILE
    try:
        layout.execution.mkdir(exist_ok=True)
        with closing(_connect(path)) as connection, connection:
            _update(connection, layout, versions)
    except (OSError, sqlite3.Error) as error:
        raise StorageError(f"{path}: cannot be written: {error}.") from error


def _connect(path: Path) -> sqlite3.Connection:
    """The file; one that is not ours is made anew, as all of it is derived."""
    connection = sqlite3.connect(path)
    try:
        known = connection.execute("SELECT name FROM sqlite_master").fetchall()
    except sqlite3.DatabaseError:
        known = [("damaged",)]
    if known and (_LOADED,) not in known:
        connection.close()
        path.unlink()
        connection = sqlite3.connect(path)
    connection.execute(f"CREATE TABLE IF NOT EXISTS {_LOADED} (path PRIMARY KEY, version)")
    return connection


def _update(connection: sqlite3.Connection, layout: Layout, versions: Mapping[str, str]) -> None:
    loaded = dict(connection.execute(f"SELECT path, version FROM {_LOADED}"))  # noqa: S608
    stale = [run for run, version in versions.items() if loaded.get(run) != version]
    tables = _tables(connection)
    _remove(connection, tables, [run for run in loaded if versions.get(run) != loaded[run]])
    for run in stale:
        for table, path in csv_files(layout.run(run)).items():
            _load(connection, tables.setdefault(table.lower(), []), table, run, path)
    connection.executemany(
        f"REPLACE INTO {_LOADED} VALUES (?, ?)",  # noqa: S608
        ((run, versions[run]) for run in stale),
    )


def _tables(connection: sqlite3.Connection) -> dict[str, list[str]]:
    """Columns of every table, by its name in small letters."""
    rows = connection.execute(
        "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c "
        "WHERE m.type = 'table' AND m.name <> ?",
        (_LOADED,),
    )
    found: dict[str, list[str]] = {}
    for table, column in rows:
        found.setdefault(table.lower(), []).append(column)
    return found


def _remove(connection: sqlite3.Connection, tables: Iterable[str], runs: Sequence[str]) -> None:
    keys = [(variant, int(number)) for variant, _, number in (r.rpartition("/") for r in runs)]
    for table in tables if keys else ():
        connection.executemany(
            f"DELETE FROM {quoted(table)} WHERE config = ? AND run = ?",  # noqa: S608
            keys,
        )
    connection.executemany(
        f"DELETE FROM {_LOADED} WHERE path = ?",  # noqa: S608
        ((run,) for run in runs),
    )


def _load(
    connection: sqlite3.Connection, have: list[str], table: str, run: str, path: Path
) -> None:
    columns = column_names(read_header(path))
    if not columns:
        return
    for statement in _declared(have, table, columns):
        connection.execute(statement)
    variant, _, number = run.rpartition("/")
    places = ", ".join("?" * (len(columns) + 2))
    names = ", ".join(map(quoted, [*KEYS, *columns]))
    connection.executemany(
        f"INSERT INTO {quoted(table)} ({names}) VALUES ({places})",  # noqa: S608
        (
            [variant, number, *(cell or None for cell in row)]
            for row in read_rows(path, len(columns))
        ),
    )


def _declared(have: list[str], table: str, columns: Sequence[str]) -> Iterator[str]:
    """What makes a table hold the columns; `have` is brought up to date.

    NUMERIC columns take numbers as such and leave text as it is.
    """
    known = {name.lower() for name in have}
    new = [name for name in columns if name.lower() not in known]
    if not have:
        listed = ", ".join(f"{quoted(name)} NUMERIC" for name in columns)
        yield f"CREATE TABLE {quoted(table)} (config TEXT, run INTEGER, {listed})"
        yield f"CREATE INDEX {quoted(f'{table}_by_run')} ON {quoted(table)} (config, run)"
    else:
        yield from (f"ALTER TABLE {quoted(table)} ADD {quoted(name)} NUMERIC" for name in new)
    have += new
