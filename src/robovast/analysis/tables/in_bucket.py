"""Finds the tables of a campaign in its bucket."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from robovast.analysis.tables.columnar import write_runs
from robovast.analysis.tables.runs import COLUMNS, Row, plain_time
from robovast.analysis.tables.stored import StoredTables
from robovast.base.errors import InputError, StorageError
from robovast.campaign.layout import COLUMNAR_TABLES, INDEX, RUNS_TABLE
from robovast.storage.s3 import ObjectStore, StoredObject

LARGEST_INDEX = 2**30
"""Largest list of runs that is read [byte]."""


def tables_in(store: ObjectStore, bucket: str, campaign: str, scratch: Path) -> StoredTables | Path:
    """The tables of a campaign in a bucket: the newest of those that are as new as its runs.

    Results processing in the cluster makes `tables.duckdb`, the end of every campaign
    `runs.duckdb`. Older versions made neither: then the list of runs is read.

    Args:
        store: the S3 server.
        bucket: the campaign's.
        campaign: name of its results folder.
        scratch: existing folder for a copy of the list of runs, which lasts as long as the tables.

    Raises:
        InputError: no run of the campaign is listed yet.
        StorageError: the bucket cannot be read.
    """
    index = store.find(bucket, INDEX)
    for key in (COLUMNAR_TABLES, RUNS_TABLE):
        found = store.find(bucket, key)
        if found is not None and (index is None or found.modified >= index.modified):
            return StoredTables(campaign, found.size, partial(store.read_part, bucket, found))
    if index is None:
        raise InputError(
            f"{campaign}: there is nothing to ask in the bucket {bucket} yet: its tables are made "
            "when all runs have ended. `vast results download` fetches the runs that are stored."
        )
    return _from_index(store, bucket, campaign, index, scratch)


def _from_index(
    store: ObjectStore, bucket: str, campaign: str, index: StoredObject, scratch: Path
) -> Path:
    """The folder of a campaign that has the tables of its list of runs, and nothing else."""
    content = store.read(bucket, index.key, LARGEST_INDEX)
    try:
        rows = list(_rows(json.loads(content or b"")))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise StorageError(f"{bucket}/{INDEX} is damaged: {error!r}.") from error
    folder = scratch / campaign
    path = folder / COLUMNAR_TABLES
    path.parent.mkdir(parents=True)
    write_runs(path, rows)
    return folder


def _rows(index: Any) -> Iterator[Row]:
    """The rows of stored runs; others have none after a download either."""
    for entry in index["runs"]:
        if entry["attempt"]:
            known = {name: entry.get(name) for name in COLUMNS}
            yield {
                **known,
                "config": str(entry["variant"]),
                "run": int(entry["run"]),
                "started_at": plain_time(str(entry.get("started_at"))),
                "finished_at": plain_time(str(entry.get("finished_at"))),
            }
