"""What a download fetches: the plan, made of a bucket's listing and the campaign's folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.object_keys import run_of, set_apart, why_no_place
from robovast.campaign.run_files import is_writers, shown
from robovast.storage.bucket_runs import BucketFile, RunObjects
from robovast.storage.s3 import StoredObject


@dataclass(frozen=True)
class DownloadPlan:
    """What is to be downloaded."""

    runs: tuple[RunObjects, ...]
    """Complete runs that are missing here, or were repeated since."""
    files: tuple[BucketFile, ...]
    """Other files that are missing here, or have changed since."""
    present: int = 0
    """Number of runs that are here already."""
    unfinished: tuple[str, ...] = ()
    """Runs that are not stored yet."""
    warnings: tuple[str, ...] = ()
    """Warnings about objects that are left out or stored under other paths."""


def plan_download(
    objects: Iterable[StoredObject], campaign: Path, *, force: bool = False
) -> DownloadPlan:
    """Determine what to download from the objects of a bucket."""
    runs: dict[str, list[StoredObject]] = {}
    counts: Counter[str] = Counter()
    sizes: Counter[str] = Counter()
    files: list[StoredObject] = []
    refused: dict[str, str] = {}
    for item in objects:
        run = run_of(item.key)
        if reason := why_no_place(item.key):
            refused[item.key] = reason
        elif run:
            counts[run] += 1
            sizes[run] += item.size
            known = runs.setdefault(run, [])
            if not is_writers(item.key[len(run) + 1 :]):
                known.append(item)
        else:
            files.append(item)
    apart = set_apart([*(item.key for item in files), *(f"{run}/{RUN_RECORD}" for run in runs)])
    placed = [BucketFile(apart.get(item.key, item.key), item) for item in files]
    wanted, unfinished, present = [], [], 0
    for path, parts in runs.items():
        record = next((item for item in parts if item.key == f"{path}/{RUN_RECORD}"), None)
        if record is None:
            unfinished.append(path)
        elif not force and is_here(record, campaign / record.key):
            present += 1
        else:
            wanted.append(RunObjects(path, tuple(parts), counts[path], sizes[path]))
    return DownloadPlan(
        runs=tuple(wanted),
        files=tuple(
            file for file in placed if force or not is_here(file.item, campaign / file.path)
        ),
        present=present,
        unfinished=tuple(unfinished),
        warnings=(
            *(f"{shown(key)!r} is left in the bucket: {why}." for key, why in refused.items()),
            *renamed_warnings(apart),
        ),
    )


def renamed_warnings(apart: Mapping[str, str]) -> Iterator[str]:
    """Warnings about files that are stored under other paths; see `set_apart`."""
    for path, place in apart.items():
        yield f"{path!r} is a file in the bucket, and a folder: here the file is {place!r}."


def is_here(item: StoredObject, path: Path) -> bool:
    """Whether a file has the size and the time of an object."""
    try:
        found = path.stat()
    except OSError:
        return False
    return found.st_size == item.size and int(found.st_mtime) == int(item.modified)
