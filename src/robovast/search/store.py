"""`campaign.db` of a search, written anew at each batch's end from its history."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from typing import Any

from robovast.analysis.tables.campaign_store import SCHEMA
from robovast.base.atomic import appearing_file
from robovast.base.errors import StorageError
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.layout import Layout
from robovast.model.document import Document
from robovast.model.naming import CAMPAIGN_STORE
from robovast.search.ending import Stop
from robovast.search.history import Batch, SearchHistory


def write_search_store(
    layout: Layout, document: Document, history: SearchHistory, stop: Stop | None
) -> None:
    """Replace the store by one of all batches that were scored.

    Raises:
        StorageError: the file cannot be written.
    """
    path = layout.root / CAMPAIGN_STORE
    try:
        with (
            appearing_file(path) as part,
            closing(sqlite3.connect(part)) as connection,
            connection,
        ):
            _write(connection, layout, document, history, stop)
    except (OSError, sqlite3.Error) as error:
        raise StorageError(f"{path}: cannot be written: {error}.") from error


def _write(
    connection: sqlite3.Connection,
    layout: Layout,
    document: Document,
    history: SearchHistory,
    stop: Stop | None,
) -> None:
    connection.executescript(SCHEMA)
    done = history.finished
    created = (
        done[0].outcome.finished_at - done[0].outcome.elapsed if done and done[0].outcome else 0.0
    )
    connection.execute(
        "INSERT INTO campaign (id, name, mode, config_dir, config_json, created_at, stop_kind, "
        "stop_reason, batches, elapsed_s) VALUES (1, ?, 'search', '_config', ?, ?, ?, ?, ?, ?)",
        (
            layout.root.name,
            json.dumps(read_mapping_leniently(document.path), default=str),
            created,
            stop.kind if stop else None,
            stop.reason if stop else None,
            len(done),
            history.elapsed,
        ),
    )
    for batch in done:
        at = batch.outcome.finished_at if batch.outcome else 0.0
        connection.execute(
            "INSERT INTO batch VALUES (?, 1, ?, '.', ?)", (batch.number + 1, batch.number, at)
        )
        connection.executemany(
            "INSERT INTO unit (batch_id, paramset_id, config_name, params_json, objective, "
            "objectives_json, measures_json, n_samples, status, result_dir, created_at) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            _units(document, batch, at),
        )


def _units(document: Document, batch: Batch, at: float) -> Iterator[tuple[Any, ...]]:
    """One row per set."""
    search, outcome = document.vast.search, batch.outcome
    first = search.objectives[0].name if search and len(search.objectives) == 1 else ""
    scores = {score.id: score for score in outcome.scores} if outcome else {}
    for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True):
        score = scores[params.id]
        yield (
            batch.number + 1,
            params.id,
            config,
            json.dumps(params.values),
            score.objectives.get(first),
            json.dumps(dict(score.objectives)),
            json.dumps(dict(score.measures)),
            score.n_samples,
            "errored" if score.error else "evaluated",
            config,
            at,
        )
