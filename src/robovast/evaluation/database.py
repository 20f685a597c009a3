"""Opens untrusted SQLite files read-only."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from robovast.base.errors import InputError
from robovast.evaluation.inside import MissingError, resolved

TIME_LIMIT = 30.0
"""Time limit for all queries to one file [s]."""
_STEPS = 100_000
"""Number of virtual machine instructions between checks of the time."""


@contextmanager
def opened(root: Path, relative: str) -> Iterator[sqlite3.Connection]:
    """A connection that neither writes nor executes code defined in the file.

    Raises:
        InputError: the file is missing below `root`, damaged, or takes too long.
    """
    path = resolved(root, relative)
    if not path.is_file():
        raise MissingError(f"{relative} is no file.")
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
            end = time.monotonic() + TIME_LIMIT
            connection.execute("PRAGMA trusted_schema = OFF")
            connection.execute("PRAGMA cell_size_check = ON")
            connection.set_progress_handler(lambda: time.monotonic() > end, _STEPS)
            yield connection
    except (sqlite3.Error, OverflowError) as error:
        raise InputError(f"{relative} cannot be read: {error}.") from None


def require_tables(connection: sqlite3.Connection, relative: str, *names: str) -> None:
    """Refuse views and virtual tables, which can have rows without end.

    Raises:
        InputError: one of some names is not that of a table.
    """
    rows = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
    )
    missing = sorted(set(names) - {name for (name,) in rows})
    if missing:
        raise InputError(f"{relative} is no bag: it has no table {', '.join(missing)}.")
