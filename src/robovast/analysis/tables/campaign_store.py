"""`campaign.db` (SQLite): the campaign, its batches, its parameter sets and their results.

Scripts of the existing tool's users read it; RoboVAST itself does not.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.analysis.tables.runs import PARAMETER, run_rows
from robovast.base.atomic import appearing_file
from robovast.base.errors import StorageError
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.layout import Layout
from robovast.model.naming import CAMPAIGN_STORE

_OURS = 0x524F424F
"""SQLite application id of databases made from a results folder; these may be replaced."""
SCHEMA = """
PRAGMA user_version = 1;
CREATE TABLE campaign (id INTEGER PRIMARY KEY, name TEXT, mode TEXT, config_dir TEXT,
    config_json TEXT, created_at REAL, strategy_state BLOB, stop_kind TEXT, stop_reason TEXT,
    batches INTEGER, elapsed_s REAL);
CREATE TABLE batch (id INTEGER PRIMARY KEY, campaign_id INTEGER REFERENCES campaign, idx INTEGER,
    dir TEXT, created_at REAL);
CREATE TABLE unit (id INTEGER PRIMARY KEY, batch_id INTEGER REFERENCES batch, paramset_id TEXT,
    config_name TEXT, params_json TEXT, objective REAL, objectives_json TEXT, measures_json TEXT,
    n_samples INTEGER, status TEXT, result_dir TEXT, created_at REAL);
"""
"""Times are in seconds since the epoch."""

Row = Mapping[str, Any]


def write_campaign_store(layout: Layout, document: Path | None, runs: Iterable[str]) -> None:
    """Write the store of a finished campaign; a store written by a search is kept.

    Args:
        layout: the campaign's layout.
        document: its .vast file.
        runs: all runs, as `<variant>/<number>`.

    Raises:
        StorageError: the file cannot be written.
    """
    path = layout.root / CAMPAIGN_STORE
    try:
        if os.path.exists(path) and not _is_ours(path):
            return
        with (
            appearing_file(path) as part,
            closing(sqlite3.connect(part)) as connection,
            connection,
        ):
            _write(connection, layout, document, list(run_rows(layout, runs)))
    except (OSError, sqlite3.Error) as error:
        raise StorageError(f"{path}: cannot be written: {error}.") from error


def index_campaign(layout: Layout, *, force: bool) -> bool:
    """Write a campaign's store unless it is newer than all runs; return whether it was written.

    Raises:
        StorageError: the file cannot be written.
    """
    runs = list(layout.run_folders())
    path = layout.root / CAMPAIGN_STORE
    if not force and os.path.isfile(path):
        made = path.stat().st_mtime
        if all(folder.stat().st_mtime < made for folder in runs):
            return False
    documents = layout.documents
    names = (str(folder.relative_to(layout.root)) for folder in runs)
    write_campaign_store(layout, documents[0] if documents else None, names)
    return True


def _is_ours(path: Path) -> bool:
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as connection:
            return bool(connection.execute("PRAGMA application_id").fetchone()[0] == _OURS)
    except sqlite3.Error:
        return False


def _write(
    connection: sqlite3.Connection, layout: Layout, document: Path | None, rows: list[Row]
) -> None:
    connection.executescript(SCHEMA)
    connection.execute(f"PRAGMA application_id = {_OURS}")
    created = _begun(rows)
    config = read_mapping_leniently(document) if document else {}
    connection.execute(
        "INSERT INTO campaign (id, name, mode, config_dir, config_json, created_at, batches, "
        "elapsed_s) VALUES (1, ?, ?, '_config', ?, ?, 1, ?)",
        (
            layout.root.name,
            "search" if config.get("search") else "batch",
            json.dumps(config, default=str),
            created,
            sum(row["duration"] or 0.0 for row in rows),
        ),
    )
    connection.execute("INSERT INTO batch VALUES (1, 1, 0, '.', ?)", (created,))
    connection.executemany(
        "INSERT INTO unit (batch_id, paramset_id, config_name, params_json, objectives_json, "
        "measures_json, n_samples, status, result_dir, created_at) "
        "VALUES (1, ?, ?, ?, '{}', '{}', ?, ?, ?, ?)",
        _units(rows),
    )


def _units(rows: Iterable[Row]) -> Iterator[tuple[Any, ...]]:
    """One row per variant."""
    variants: dict[str, list[Row]] = {}
    for row in rows:
        variants.setdefault(row["config"], []).append(row)
    for name, group in variants.items():
        parameters = {
            key.removeprefix(PARAMETER): value
            for key, value in group[0].items()
            if key.startswith(PARAMETER)
        }
        status = _status(Counter(row["verdict"] for row in group))
        yield name, name, json.dumps(parameters), len(group), status, name, _begun(group)


def _begun(rows: Iterable[Row]) -> float | None:
    """When the first of some runs began."""
    starts = (str(row["started_at"]) for row in rows if row["started_at"])
    moments = (datetime.fromisoformat(start).replace(tzinfo=UTC) for start in starts)
    return min((moment.timestamp() for moment in moments), default=None)


def _status(verdicts: Counter[str]) -> str:
    """The worst of the verdicts."""
    return next((v for v in ("errored", "failed", "interrupted") if verdicts[v]), "passed")
