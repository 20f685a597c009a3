"""Names of the configurations of campaigns by their parameters, kept in the user's cache.

The parameters of a configuration never change, and a campaign's folder changes when it gets a
further one; so a campaign is read once, and one look-up replaces thousands of files.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from robovast.base.serialization import fingerprint
from robovast.evaluation.campaigns import is_own_folder
from robovast.evaluation.stored_runs import read_parameters
from robovast.execution.local.process_environment import cache_folder

_SCHEMA = """
CREATE TABLE IF NOT EXISTS campaign (
    id INTEGER PRIMARY KEY, path TEXT UNIQUE NOT NULL, changed INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS configuration (
    campaign INTEGER NOT NULL REFERENCES campaign ON DELETE CASCADE,
    identity TEXT NOT NULL, name TEXT NOT NULL, PRIMARY KEY (campaign, identity)) WITHOUT ROWID;
"""
_VERSION = 1
_PATIENCE = 0.1
"""How long another program may hold the file; reading a campaign instead takes a second [s]."""
_CHECKED = 100
"""Configurations that are read between looks at the clock."""
_SETTLED = 2.0
"""A folder that changed more recently may change again within the same time stamp [s]."""


class ConfigurationIndex:
    """An index in a file; thread-safe. Where the file cannot be used, nothing is kept."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = Lock()

    def find(self, campaign: Path, identity: str, until: float) -> str | None:
        """The name of a configuration in a campaign; empty if it has none.

        Args:
            campaign: its folder, without links.
            identity: of the configuration's parameters.
            until: when to end reading a campaign that is not known [s, monotonic].

        Returns:
            None if there was not enough time.
        """
        with self._lock:
            try:
                changed = campaign.stat().st_mtime_ns
                known = self._in_file(lambda file: _known(file, campaign, changed, identity))
                if known is not None:
                    return known
                names = _read(campaign, until)
            except OSError:  # the campaign was removed
                return ""
            if names is None:
                return None
            if names.complete and time.time() - changed / 1e9 > _SETTLED:
                self._in_file(lambda file: _store(file, campaign, changed, names.by_identity))
            return names.by_identity.get(identity, "")

    def _in_file(self, work: Callable[[sqlite3.Connection], str | None]) -> str | None:
        """Do something in the file; None where it cannot be used: one can do without it."""
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with closing(sqlite3.connect(self._path, timeout=_PATIENCE)) as file, file:
                _prepare(file)
                return work(file)
        except (sqlite3.OperationalError, OSError, UnicodeError):  # locked, full, of nobody
            return None
        except sqlite3.Error:  # damaged: the next one makes it anew
            with suppress(OSError):
                self._path.unlink()
            return None


@dataclass(frozen=True)
class _Names:
    by_identity: dict[str, str]
    complete: bool
    """Whether all configurations have parameters; those of one that is being written may follow."""


def default_index() -> ConfigurationIndex:
    """The index in the user's cache."""
    return ConfigurationIndex(cache_folder() / "configurations.db")


def _prepare(file: sqlite3.Connection) -> None:
    """Make the tables, unless they are there.

    Raises:
        sqlite3.OperationalError: the index is of another version of RoboVAST.
    """
    version = file.execute("PRAGMA user_version").fetchone()[0]
    if version not in (0, _VERSION):
        raise sqlite3.OperationalError("an index of another version")
    file.execute("PRAGMA foreign_keys = ON")
    if not version:
        file.executescript(f"{_SCHEMA}PRAGMA user_version = {_VERSION};")


def _known(file: sqlite3.Connection, campaign: Path, changed: int, identity: str) -> str | None:
    """The name of a configuration in a campaign that is known, empty if it has none."""
    query = "SELECT id FROM campaign WHERE path = ? AND changed = ?"
    found = file.execute(query, (str(campaign), changed)).fetchone()
    if found is None:
        return None
    query = "SELECT name FROM configuration WHERE campaign = ? AND identity = ?"
    row = file.execute(query, (found[0], identity)).fetchone()
    return str(row[0]) if row else ""


def _read(campaign: Path, until: float) -> _Names | None:
    """Names of all configurations by identity; None if there was not enough time."""
    found: dict[str, str] = {}
    complete = True
    names = sorted(entry.name for entry in os.scandir(campaign) if is_own_folder(entry))
    for place, name in enumerate(names):
        if place % _CHECKED == 0 and time.monotonic() > until:
            return None
        parameters = read_parameters(campaign.parent, campaign.name, name)
        if parameters:
            found.setdefault(fingerprint(parameters), name)
        complete &= bool(parameters)
    return _Names(found, complete)


def _store(file: sqlite3.Connection, campaign: Path, changed: int, names: dict[str, str]) -> None:
    """Replace the stored state of a campaign, and remove campaigns whose folders are gone."""
    known = file.execute("SELECT path FROM campaign").fetchall()
    gone = [(path,) for (path,) in known if path == str(campaign) or not os.path.isdir(path)]
    file.executemany("DELETE FROM campaign WHERE path = ?", gone)
    query = "INSERT INTO campaign (path, changed) VALUES (?, ?)"
    number = file.execute(query, (str(campaign), changed)).lastrowid
    file.executemany(
        "INSERT INTO configuration VALUES (?, ?, ?)",
        ((number, identity, name) for identity, name in names.items()),
    )
