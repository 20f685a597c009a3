"""Makes tables from the list of runs in a bucket, where an older version stored no tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast.analysis.tables.columnar import write_runs
from robovast.analysis.tables.runs import COLUMNS, Row, plain_time
from robovast.base.errors import StorageError
from robovast.campaign.layout import COLUMNAR_TABLES, INDEX
from robovast.storage.s3 import ObjectStore

LARGEST_INDEX = 2**30
"""Largest list of runs that is read [byte]."""


def tables_from_index(store: ObjectStore, bucket: str, campaign: str, scratch: Path) -> Path:
    """The folder of a campaign that has the tables of its list of runs, and nothing else.

    Raises:
        StorageError: the list is damaged, or cannot be read.
    """
    content = store.read(bucket, INDEX, LARGEST_INDEX)
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
