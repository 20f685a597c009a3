"""The finished postprocessing, stored in `<campaign>/.cache/postprocessing.db`.

A row claims finished work. It is written after the work, and withdrawn before the work is repeated:
a crash may lose claims but never leaves false ones.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from robovast.base.errors import StorageError
from robovast.base.locks import lock_file

FOLDER = ".cache"
FILE = "postprocessing.db"
SCHEMA = 1


@dataclass(frozen=True)
class Unit:
    """State of a run's folder, or of the campaign itself (empty path)."""

    path: str
    signature: str = ""
    """Signature of all files when the last command had ended."""
    inputs: str = ""
    """Digest of the content that no command made."""
    made: dict[str, str] = field(default_factory=dict)
    """Digests of the files that commands made, by relative path."""
    done: frozenset[str] = frozenset()
    """Keys of the commands that succeeded with these inputs."""

    def without(self, keys: Iterable[str]) -> Unit:
        """The same unit without some of its claims."""
        return replace(self, done=self.done - set(keys))


class TableState:
    """The stored rows of one campaign."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def units(self) -> dict[str, Unit]:
        """All rows by path."""
        rows = self._connection.execute("SELECT path, signature, inputs, made, done FROM unit")
        return {
            path: Unit(path, sign, inputs, json.loads(made), frozenset(done.split()))
            for path, sign, inputs, made, done in rows
        }

    def store(self, units: Iterable[Unit]) -> None:
        """Write rows; rows of the same path are replaced."""
        rows = [
            (u.path, u.signature, u.inputs, json.dumps(u.made), " ".join(sorted(u.done)))
            for u in units
        ]
        with self._connection:
            self._connection.executemany("REPLACE INTO unit VALUES (?, ?, ?, ?, ?)", rows)

    def remove(self, paths: Iterable[str]) -> None:
        """Remove units that no longer exist."""
        with self._connection:
            self._connection.executemany("DELETE FROM unit WHERE path = ?", ((p,) for p in paths))

    def note(self, name: str) -> str:
        """The value stored under a name; empty if there is none."""
        row = self._connection.execute("SELECT value FROM note WHERE name = ?", (name,)).fetchone()
        return str(row[0]) if row else ""

    def set_note(self, name: str, value: str) -> None:
        """Note something."""
        with self._connection:
            self._connection.execute("REPLACE INTO note VALUES (?, ?)", (name, value))


@contextmanager
def opened(campaign: Path) -> Iterator[TableState]:
    """Open the state of a campaign, for one process at a time.

    Raises:
        StorageError: another process works on the campaign, or the file cannot be written.
    """
    folder = campaign / FOLDER
    try:
        folder.mkdir(exist_ok=True)
        with (folder / "lock").open("w") as lock:
            if not lock_file(lock.fileno(), folder):
                raise StorageError(
                    f"{campaign}: another `vast results postprocess` is processing it",
                    hint="wait for its end",
                )
            with contextlib.closing(_connect(folder / FILE)) as connection:
                yield TableState(connection)
    except (OSError, sqlite3.Error) as error:
        raise StorageError(f"{campaign}: postprocessing cannot write: {error}.") from error


def _connect(path: Path) -> sqlite3.Connection:
    """The database; a damaged one, or one of another version, is recreated, since it is a cache."""
    connection = sqlite3.connect(path)
    try:
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        if version == SCHEMA and connection.execute("PRAGMA quick_check").fetchone()[0] == "ok":
            return connection
    except sqlite3.DatabaseError:
        version = -1
    if version != 0:
        connection.close()
        path.unlink()
        connection = sqlite3.connect(path)
    with connection:
        connection.execute(
            "CREATE TABLE IF NOT EXISTS unit "
            "(path TEXT PRIMARY KEY, signature TEXT, inputs TEXT, made TEXT, done TEXT)"
        )
        connection.execute("CREATE TABLE IF NOT EXISTS note (name TEXT PRIMARY KEY, value TEXT)")
        connection.execute(f"PRAGMA user_version = {SCHEMA}")
    return connection
