"""Opens untrusted SQLite files read-only."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from robovast.base.bounds import LARGEST
from robovast.base.errors import InputError

TIME_LIMIT = 30.0
"""Time limit for all queries to one file [s]."""
_STEPS = 100_000
"""Number of virtual machine instructions between checks of the time."""


@contextmanager
def opened(
    path: Path, name: str = "", seconds: float | None = None
) -> Iterator[sqlite3.Connection]:
    """A connection that neither writes nor executes code defined in the file.

    The log of a recorder that was killed is read, too. Text that is not UTF-8 is replaced.

    Args:
        path: the file.
        name: its name in errors; by default the file's.
        seconds: time limit for all queries; by default `TIME_LIMIT` [s].

    Raises:
        InputError: the file is damaged, a value is larger than `LARGEST`, or it takes too long.
    """
    try:
        with closing(_connect(path)) as connection:
            end = time.monotonic() + (TIME_LIMIT if seconds is None else seconds)
            connection.set_progress_handler(lambda: time.monotonic() > end, _STEPS)
            yield connection
    except (sqlite3.Error, OverflowError) as error:
        raise InputError(f"{name or path.name} cannot be read: {error}.") from None


def require_tables(connection: sqlite3.Connection, name: str, *tables: str) -> None:
    """Refuse views and virtual tables, which can have rows without end.

    Raises:
        InputError: one of the names is not that of a table.
    """
    missing = sorted(set(tables) - tables_of(connection))
    if missing:
        raise InputError(
            f"{name} is not a valid bag: it has no table {', '.join(missing)}.",
            hint="record the bag again, or remove the file",
        )


def tables_of(connection: sqlite3.Connection) -> set[str]:
    """Names of the tables in a file, without views and virtual tables."""
    rows = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
    )
    return {name for (name,) in rows}


def _connect(path: Path) -> sqlite3.Connection:
    try:
        return _connected(path, "mode=ro")
    except sqlite3.OperationalError:  # on read-only file systems the log cannot be used
        return _connected(path, "immutable=1")


def _connected(path: Path, options: str) -> sqlite3.Connection:
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?{options}", uri=True)
    try:
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST)
        connection.text_factory = lambda text: text.decode("utf-8", "replace")
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        # Otherwise SQLite refuses a truncated file as a whole.
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute("SELECT count(*) FROM sqlite_master")
    except sqlite3.Error:
        connection.close()
        raise
    return connection
