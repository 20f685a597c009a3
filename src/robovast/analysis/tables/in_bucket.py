"""Finds the tables of a campaign in its bucket."""

from __future__ import annotations

from functools import partial

from robovast.analysis.tables.stored import StoredTables
from robovast.base.errors import InputError
from robovast.campaign.layout import COLUMNAR_TABLES, INDEX, RUNS_TABLE
from robovast.storage.s3 import ObjectStore


def tables_in(store: ObjectStore, bucket: str, campaign: str) -> StoredTables:
    """The tables of a campaign in a bucket: the newest of those that are as new as its runs.

    Results processing in the cluster makes `tables.duckdb`, the end of every campaign
    `runs.duckdb`.

    Args:
        store: the S3 server.
        bucket: the campaign's.
        campaign: name of its results folder.

    Raises:
        InputError: no run of the campaign is listed yet.
        StorageError: the bucket cannot be read.
    """
    index = store.find(bucket, INDEX)
    for key in (COLUMNAR_TABLES, RUNS_TABLE):
        found = store.find(bucket, key)
        if found is not None and (index is None or found.modified >= index.modified):
            return StoredTables(campaign, found.size, partial(store.read_part, bucket, found))
    raise InputError(
        f"{campaign}: the bucket {bucket} contains no tables yet. They are created when all runs "
        "have finished",
        hint="run `vast results download` to download the stored runs",
    )
