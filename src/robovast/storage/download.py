"""Downloads a campaign from S3: in parallel, resumable, verified, each run whole or not at all.

```
<campaign>/
   <variant>/<run>/         a complete run; its `run.json` has the time of the object in S3
   .download/<variant>/…    incomplete runs; removed at the end
```
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from threading import Event, Lock
from typing import Protocol, TypeVar

from robovast.base.atomic import put_in_place
from robovast.base.errors import RobovastError, StorageError, with_hint
from robovast.base.file_errors import cause
from robovast.base.locks import exclusive_folder
from robovast.base.safe_paths import read_file
from robovast.campaign.imported import mark_imported
from robovast.campaign.layout import (
    EXECUTION_RECORD,
    JOB_LINK,
    PARTS,
    RUN_RECORD,
    STAGE,
    job_link_target,
)
from robovast.model.naming import CONFIG, TRANSIENT
from robovast.storage.bucket_ownership import owner_of
from robovast.storage.bucket_runs import BucketFile, OpenedRun, RunObjects, in_batches, open_run
from robovast.storage.download_plan import DownloadPlan, is_here, plan_download, renamed_warnings
from robovast.storage.folder_ownership import occupy
from robovast.storage.s3 import ObjectStore
from robovast.storage.s3_errors import ObjectError

T = TypeVar("T")

THREADS = 8
"""Number of parallel downloads."""
MOST_LISTED = 5
"""Most broken runs that an error names."""
MOST_SHOWN = 100
"""Longest file path in an error [characters]."""

_UNKEEPABLE = frozenset(
    {errno.EEXIST, errno.EILSEQ, errno.EINVAL, errno.EISDIR, errno.ENAMETOOLONG, errno.ENOTDIR}
)
"""Errors of a file system about a single file."""
_JOB = re.compile(r"[\w-][\w.-]*(/[\w-][\w.-]*)*")


class DownloadObserver(Protocol):
    """Receives progress events from several threads, one at a time."""

    def planned(self, files: int, size: int) -> None:
        """Numbers of files and bytes to download; called again when they grow."""

    def received(self, size: int) -> None:
        """More bytes have arrived."""

    def file_finished(self) -> None:
        """Another file is complete."""


class Silent:
    """Tells nobody."""

    def planned(self, files: int, size: int) -> None:
        """Say nothing."""

    def received(self, size: int) -> None:
        """Say nothing."""

    def file_finished(self) -> None:
        """Say nothing."""


@dataclass(frozen=True)
class DownloadResult:
    """Result of a download."""

    campaign: Path
    fetched: int
    """Number of downloaded runs."""
    present: int
    """Number of runs that were here already."""
    unfinished: tuple[str, ...]
    """Runs that the cluster has not stored yet."""
    size: int
    """Size of the downloaded files [byte]."""
    lacking: tuple[str, ...] = ()
    """Downloaded runs with files that could not be stored; their records list those."""
    warnings: tuple[str, ...] = ()
    """Warnings about objects that are left out or stored under other paths."""


def download_campaign(
    store: ObjectStore,
    bucket: str,
    campaign: Path,
    observer: DownloadObserver,
    *,
    force: bool = False,
    run: str | None = None,
    below: Sequence[str] = ("",),
    imported: bool = False,
) -> DownloadResult:
    """Download the stored part of a campaign to its folder.

    A run appears in the folder with all its files or not at all. Existing files are skipped, and
    partial files are resumed.

    Args:
        store: the S3 server.
        bucket: the campaign's bucket.
        campaign: the campaign's folder; created if missing.
        observer: receives progress events.
        force: download everything, including existing files.
        run: download only this run, `<variant>/<number>`, and what a replay needs beside it.
        below: download only what is below one of these prefixes.
        imported: mark the campaign as imported: every holder of the storage keys can write to it.

    Raises:
        OtherOwnerError: the folder belongs to another campaign.
        StorageError: the bucket cannot be read, the folder cannot be written, or some files
            could not be downloaded; the others are kept.
    """
    refusal = f"{campaign}: another download writes to this folder"
    hint = "wait until the other download ends"
    with _storage_errors(campaign), exclusive_folder(campaign / STAGE, refusal, hint):
        occupy(campaign, owner_of(store, bucket))
        if imported:
            mark_imported(campaign)
        found = chain.from_iterable(store.objects(bucket, prefix) for prefix in below)
        objects = (item for item in found if run is None or _is_needed(item.key, run))
        plan = plan_download(objects, campaign, force=force)
        done = _Fetching(store, bucket, campaign, observer).fetch(plan)
    return DownloadResult(
        campaign=campaign,
        fetched=done.runs,
        present=plan.present,
        unfinished=plan.unfinished,
        size=done.size,
        lacking=tuple(done.lacking),
        warnings=(*plan.warnings, *done.warnings),
    )


def _is_needed(key: str, run: str) -> bool:
    """Whether an object belongs to a run, or to the inputs that it was made from."""
    variant = run.partition("/")[0]
    inputs = (f"{CONFIG}/", f"{TRANSIENT}/", f"{variant}/{CONFIG}/", f"{run}/", EXECUTION_RECORD)
    return key.startswith(inputs) and not key.startswith((PARTS, f"{TRANSIENT}/job-"))


@dataclass
class _Done:
    """Downloads that are finished or in progress."""

    files: int = 0
    size: int = 0
    """[byte]"""
    runs: int = 0
    lacking: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def add(self, files: Iterable[BucketFile], runs: Sequence[OpenedRun]) -> None:
        """Add downloaded files and runs."""
        for file in (*files, *(file for run in runs for file in run.files)):
            self.files += 1
            self.size += file.item.size
        self.runs += len(runs)
        self.lacking += [run.path for run in runs if run.lacks_files]
        self.warnings += [line for run in runs for line in renamed_warnings(run.apart)]


class _Stopped(Exception):  # noqa: N818 - no error: it ends a thread
    """A download failed elsewhere, or the user stopped it."""


@dataclass
class _Pending:
    """A run with files that are still missing."""

    run: OpenedRun
    stage: Path
    """Folder of its files until all are here, separate from other executions."""
    left: int
    lock: Lock = field(default_factory=Lock)
    broken: bool = False
    """One of its files is not available."""

    def count_down(self) -> bool:
        """Count a finished file; return True if it was the last one."""
        with self.lock:
            self.left -= 1
            return not self.left


class _Fetching:
    """Downloads files in several threads and moves each complete run to its place.

    A broken object only affects its run; after other errors, downloads in progress finish and can
    be resumed later.
    """

    def __init__(
        self, store: ObjectStore, bucket: str, campaign: Path, observer: DownloadObserver
    ) -> None:
        self._store = store
        self._bucket = bucket
        self._campaign = campaign
        self._observer = observer
        self._lock = Lock()
        self._stop = Event()
        self._broken: dict[str, ObjectError] = {}
        """Errors by run or file."""

    def fetch(self, plan: DownloadPlan) -> _Done:
        """Download everything.

        Raises:
            StorageError: some files could not be downloaded.
        """
        done = _Done()
        files = plan.files
        with ThreadPoolExecutor(THREADS, "download") as pool:
            for batch in in_batches(plan.runs):
                found = self._do(pool, [partial(self._open, run) for run in batch])
                runs = [run for run in found if run is not None]
                done.add(files, runs)
                self._observer.planned(done.files, done.size)
                self._do(pool, list(self._tasks(files, runs)))
                files = ()
        self._refuse_broken()
        return done

    def _do(self, pool: ThreadPoolExecutor, actions: Sequence[Callable[[], T]]) -> list[T]:
        tasks = [pool.submit(action) for action in actions]
        try:
            for task in as_completed(tasks):
                task.result()
        except BaseException:
            self._stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        return [task.result() for task in tasks]

    def _open(self, run: RunObjects) -> OpenedRun | None:
        try:
            return open_run(self._store, self._bucket, run)
        except ObjectError as error:
            self._broken[run.path] = error
            return None

    def _tasks(
        self, files: Iterable[BucketFile], runs: Iterable[OpenedRun]
    ) -> Iterator[Callable[[], None]]:
        for own in files:
            yield partial(self._get_file, own)
        for run in runs:
            stage = self._campaign / STAGE / f"{run.path}.{run.tag}"
            pending = _Pending(run, stage, len(run.files))
            for file in run.files:
                yield partial(self._get_part, file, pending)

    def _get_file(self, file: BucketFile) -> None:
        try:
            with _keeping(file.path):
                target = self._campaign / file.path
                file.bring(self._store, self._bucket, target, self._received)
        except ObjectError as error:
            self._broken[file.path] = error
        self._finished()

    def _get_part(self, file: BucketFile, pending: _Pending) -> None:
        target = pending.stage / file.path[len(pending.run.path) + 1 :]
        with self._costing(pending), _keeping(file.path):
            if is_here(file.item, target):
                self._received(file.item.size)
            elif not pending.broken:
                file.bring(self._store, self._bucket, target, self._received)
        self._finished()
        if pending.count_down() and not pending.broken:
            with self._costing(pending), _keeping(pending.run.path):
                self._place(pending)

    @contextlib.contextmanager
    def _costing(self, pending: _Pending) -> Iterator[None]:
        """Restrict the effect of a broken object to its run."""
        try:
            yield
        except ObjectError as error:
            pending.broken = True
            self._broken[pending.run.path] = error

    def _finished(self) -> None:
        with self._lock:
            self._observer.file_finished()

    def _received(self, size: int) -> None:
        if self._stop.is_set():
            raise _Stopped
        with self._lock:
            self._observer.received(size)

    def _place(self, pending: _Pending) -> None:
        """Move a complete run to its place."""
        stage, target = pending.stage, self._campaign / pending.run.path
        _link_job(stage)
        put_in_place(stage, target, replace=True)

    def _refuse_broken(self) -> None:
        if self._broken:
            names = sorted(self._broken)
            reasons = " ".join(f"{name}: {self._broken[name]}" for name in names[:MOST_LISTED])
            more = f" … and {len(names) - MOST_LISTED} more." if len(names) > MOST_LISTED else ""
            raise StorageError(
                f"Downloaded all except {len(names)} runs or files. {reasons}{more}",
                hint="repeat the command",
            )


@contextlib.contextmanager
def _keeping(path: str) -> Iterator[None]:
    """Report a file that this disk cannot store as the error of one object."""
    try:
        yield
    except OSError as error:
        if error.errno not in _UNKEEPABLE:
            raise
        reasons = f"`{path[:MOST_SHOWN]}` cannot be kept on this disk: {cause(error)}."
        raise ObjectError(reasons) from error


def _link_job(run: Path) -> None:
    """Restore the link to the run's job, since S3 cannot store links."""
    target, link = job_link(run / RUN_RECORD), run / JOB_LINK
    if target is not None and not os.path.lexists(link):
        link.symlink_to(target)


def job_link(record: Path) -> Path | None:
    """Target of a run's `job` link; None if its record does not contain it."""
    try:
        job = json.loads(read_file(record))["job"]
    except (ValueError, TypeError, KeyError):
        return None  # a record of another version; all files are here
    named = isinstance(job, str) and _JOB.fullmatch(job)
    return job_link_target(job) if named else None


@contextlib.contextmanager
def _storage_errors(campaign: Path) -> Iterator[None]:
    try:
        yield
    except RobovastError as error:
        raise type(error)(
            f"{error.message.rstrip('.')}. The downloaded files are kept",
            hint=with_hint(error.hint, "repeat the command to continue"),
        ) from error
    except OSError as error:
        raise StorageError(
            f"{error.filename or campaign}: cannot be written: {cause(error)}. The downloaded "
            "files are kept",
            hint="repeat the command to continue",
        ) from error
