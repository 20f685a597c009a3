"""Checks that all files named by records exist, and removes files that no record names.

A writer that was killed, or came second, leaves objects that no record names; so does a replaced
attempt. They are removed when all pods have ended, but only after the run's record was rewritten: a
pod that was believed dead and still works then finds that its record is not in place of the one
that it has read, and stores everything again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import groupby

from robovast.agent.bucket import Bucket
from robovast.agent.untrusted_files import SIDE_BY_SIDE
from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.object_keys import run_of
from robovast.campaign.run_files import FileList, StoredFile
from robovast.campaign.run_record import RunRecord
from robovast.storage.bucket_runs import listed_files
from robovast.storage.s3_errors import ObjectError

Sizes = Mapping[str, int]
"""Objects by key, below their run's."""


def check_runs(
    bucket: Bucket, seen: Mapping[str, tuple[RunRecord | None, str | None]]
) -> dict[str, str]:
    """Compare the runs' lists of files with the bucket, and remove unlisted files.

    Args:
        bucket: the campaign's; nobody should write to it any more.
        seen: the records of its runs and their ETags, read before.

    Returns:
        What is wrong, by run.

    Raises:
        StorageError: the bucket cannot be read or written.
    """

    odd = []
    for run, sizes in _runs(bucket):
        record, etag = seen.get(run, (None, None))
        files = record.files if record is not None else None
        if record is not None and files is not None and not _is_plain(files, sizes):
            odd.append((run, partial(_check, bucket, run, record, files, etag, sizes)))
    with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        found = pool.map(lambda item: (item[0], item[1]()), odd)
        return {run: damage for run, damage in found if damage}


def _runs(bucket: Bucket) -> Iterator[tuple[str, Sizes]]:
    """The objects of each run."""
    objects = bucket.store.objects(bucket.name)
    for run, items in groupby(objects, key=lambda item: run_of(item.key)):
        if run:
            yield run, {item.key[len(run) + 1 :]: item.size for item in items}


def _is_plain(files: FileList, sizes: Sizes) -> bool:
    """Whether the number of objects allows only the record, the list and the listed files."""
    others = [size for key, size in sizes.items() if key not in {RUN_RECORD, files.key}]
    is_whole = files.key in sizes and len(others) == len(sizes) - 2
    return is_whole and (len(others), sum(others)) == (files.count, files.size)


def _check(
    bucket: Bucket,
    run: str,
    record: RunRecord,
    files: FileList,
    etag: str | None,
    sizes: Sizes,
) -> str:
    try:
        listed = listed_files(bucket.store, bucket.name, run, files)
    except ObjectError as error:
        return str(error)
    named = {RUN_RECORD, files.key, *(file.key for file in listed)}
    rest = [f"{run}/{key}" for key in sizes if key not in named]
    revised = replace(record, files=files.revised())
    if rest and bucket.settle(run, revised, etag):
        bucket.store.delete(bucket.name, rest)
    return damage_of(listed, sizes)


def damage_of(listed: list[StoredFile], sizes: Sizes) -> str:
    """The differences from a run's list; empty if there are none."""
    gone = [file.path for file in listed if file.key not in sizes]
    changed = [f.path for f in listed if f.key in sizes and sizes[f.key] != f.size]
    findings = {"missing": gone, "of another size": changed}
    return "; ".join(
        f"{len(paths)} files are {what}, {paths[0]} the first"
        for what, paths in findings.items()
        if paths
    )
