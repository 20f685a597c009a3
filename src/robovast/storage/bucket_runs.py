"""Reads runs from a bucket: exactly the files of one execution that its record names."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.object_keys import set_apart
from robovast.campaign.run_files import (
    FileList,
    StoredFile,
    is_inside,
    is_key,
    read_list,
)
from robovast.campaign.run_record import parse_run_record
from robovast.storage.s3 import ObjectStore, StoredObject
from robovast.storage.s3_errors import ObjectError

AT_ONCE = 50_000
"""Most files of runs that are held in memory at once; a single run may have more."""


@dataclass(frozen=True)
class RunObjects:
    """A stored run in the listing of a bucket."""

    path: str
    """`<variant>/<number>`."""
    objects: tuple[StoredObject, ...]
    """Objects below its path, except those in writers' own places."""
    count: int
    """Number of all objects below its path, including unreferenced ones."""
    size: int
    """Total size of these objects [byte]."""


def in_batches(runs: Iterable[RunObjects]) -> Iterator[list[RunObjects]]:
    """Split runs into batches whose files fit into memory.

    There is at least one batch, which may be empty.
    """
    batch: list[RunObjects] = []
    count = 0
    for run in runs:
        if batch and count + run.count > AT_ONCE:
            yield batch
            batch, count = [], 0
        batch.append(run)
        count += run.count
    yield batch


@dataclass(frozen=True)
class BucketFile:
    """A file and the object with its content."""

    path: str
    """Path in the campaign's folder."""
    item: StoredObject
    content: bytes | None = None
    """Content, if it was read already."""

    def bring(
        self,
        store: ObjectStore,
        bucket: str,
        target: Path,
        received: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Download it; see `ObjectStore.get_file`."""
        if self.content is None:
            store.get_file(bucket, self.item, target, received)
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(self.content)
        os.utime(target, (self.item.modified, self.item.modified))
        received(len(self.content))


@dataclass(frozen=True)
class OpenedRun:
    """A run whose files are known."""

    path: str
    """`<variant>/<number>`."""
    files: tuple[BucketFile, ...]
    """All files, the record last."""
    lacks_files: bool
    """Whether it wrote files that could not be stored."""
    apart: Mapping[str, str]
    """New paths, by old path, of files whose path is also a folder."""

    @property
    def tag(self) -> str:
        """Identifies this execution of the run."""
        return hashlib.sha256(repr(self.files).encode()).hexdigest()[:12]


def open_run(store: ObjectStore, bucket: str, run: RunObjects) -> OpenedRun:
    """Read the list of a run's files.

    Raises:
        ObjectError: its record or list of files is damaged or missing.
        StorageError: the bucket cannot be read.
    """
    key = f"{run.path}/{RUN_RECORD}"
    look = store.look(bucket, key)
    if look is None:
        raise ObjectError(
            f"{bucket}/{key} is missing: it was removed during the download.", hint="download again"
        )
    record = parse_run_record(look.content)
    if record is None or record.files is None:
        found = _files_beside(run)
    else:
        found = _named_files(store, bucket, run.path, record.files, look.modified)
    apart = set_apart([*(file.path for file in found), key])
    files = [replace(file, path=apart.get(file.path, file.path)) for file in found]
    item = StoredObject(key, len(look.content), look.modified, look.etag)
    own = BucketFile(key, item, look.content)
    lacks_files = record is not None and bool(record.missing)
    return OpenedRun(run.path, (*files, own), lacks_files, apart)


def _files_beside(run: RunObjects) -> tuple[BucketFile, ...]:
    """Files of a run whose record names none, as those of other tools."""
    below = len(run.path) + 1
    return tuple(BucketFile(i.key, i) for i in run.objects if i.key[below:] != RUN_RECORD)


def _named_files(
    store: ObjectStore, bucket: str, run: str, files: FileList, modified: float
) -> tuple[BucketFile, ...]:
    return tuple(
        BucketFile(
            f"{run}/{file.path}",
            StoredObject(f"{run}/{file.key}", file.size, modified, "", file.sha256),
        )
        for file in listed_files(store, bucket, run, files)
    )


def listed_files(store: ObjectStore, bucket: str, run: str, files: FileList) -> list[StoredFile]:
    """Read the list of files that a record refers to.

    Raises:
        ObjectError: the list is damaged or missing.
        StorageError: the bucket cannot be read.
    """
    name = f"{bucket}/{run}/{files.key}"
    if not is_inside(files.key) or not is_key(files.key):
        raise ObjectError(f"{bucket}/{run}/{RUN_RECORD} is damaged: it names no list of files.")
    content = store.read(bucket, f"{run}/{files.key}")
    if content is None:
        raise ObjectError(f"{name} is gone, the list of the run's files.")
    if hashlib.sha256(content).hexdigest() != files.sha256:
        raise ObjectError(f"{name} is damaged: it is not the list that the run's record names.")
    try:
        return read_list(content)
    except ValueError as error:
        raise ObjectError(f"{name} is damaged: {error}.") from error
