"""Bringing a campaign home from S3: in parallel, resumed, verified, each run at once or not at all.

```
<campaign>/
  <variant>/<run>/         a run, complete; its `run.json` has the time of the object in S3
  .download/<variant>/…    runs of which files are still missing; gone at the end
```
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from threading import Event, Lock
from typing import Protocol

from robovast.atomic import put_in_place
from robovast.cluster.ownership import owner_of
from robovast.cluster.storage import ObjectStore, StoredObject
from robovast.errors import RobovastError, StorageError
from robovast.locks import exclusive_folder
from robovast.results.belonging import STAGE, occupy
from robovast.results.layout import RUN_RECORD

THREADS = 8
"""Files that are fetched at once."""

_JOB = re.compile(r"[\w-][\w.-]*(/[\w-][\w.-]*)*")


class DownloadObserver(Protocol):
    """Is told what happens, from several threads, one at a time."""

    def planned(self, files: int, size: int) -> None:
        """So many files, and bytes, will be fetched."""

    def received(self, size: int) -> None:
        """So many bytes more arrived."""

    def file_finished(self) -> None:
        """One file more is here."""


class Silent:
    """Tells nobody."""

    def planned(self, files: int, size: int) -> None:
        """Say nothing."""

    def received(self, size: int) -> None:
        """Say nothing."""

    def file_finished(self) -> None:
        """Say nothing."""


@dataclass(frozen=True)
class RunObjects:
    """The objects of one run that is stored."""

    path: str
    """`<variant>/<number>`."""
    objects: tuple[StoredObject, ...]


@dataclass(frozen=True)
class DownloadPlan:
    """What is to be fetched."""

    runs: tuple[RunObjects, ...]
    """Complete runs that are not here, or were repeated since."""
    files: tuple[StoredObject, ...]
    """Other files that are not here, or have changed since."""
    present: int = 0
    """Runs that are here."""
    unfinished: tuple[str, ...] = ()
    """Runs that are not stored yet."""

    @property
    def objects(self) -> list[StoredObject]:
        """All of these files."""
        return [*self.files, *(item for run in self.runs for item in run.objects)]

    @property
    def count(self) -> int:
        """Number of files."""
        return sum(len(run.objects) for run in self.runs) + len(self.files)

    @property
    def size(self) -> int:
        """[byte]"""
        return sum(item.size for item in self.objects)


@dataclass(frozen=True)
class DownloadResult:
    """What a download did."""

    campaign: Path
    fetched: int
    """Runs that were fetched."""
    present: int
    """Runs that were here before."""
    unfinished: tuple[str, ...]
    """Runs that the cluster has not stored yet."""
    size: int
    """Bytes of the files that were fetched."""


def download_campaign(
    store: ObjectStore,
    bucket: str,
    campaign: Path,
    observer: DownloadObserver,
    *,
    force: bool = False,
) -> DownloadResult:
    """Bring what is stored of a campaign into its folder.

    A run appears in the folder with all its files or not at all. What is here already is not
    fetched again; files of which a part is here are continued.

    Args:
        store: where its bucket is.
        bucket: the campaign's bucket.
        campaign: the campaign's folder; made when it does not exist.
        observer: is told of the progress.
        force: fetch everything, also what is here.

    Raises:
        OtherOwnerError: what is in the folder is another campaign's.
        StorageError: the bucket cannot be read, the folder cannot be written, or some files
            could not be fetched; those that were stay.
    """
    refusal = f"{campaign}: another download writes into it. Wait until it has ended."
    with _explained(campaign), exclusive_folder(campaign / STAGE, refusal):
        occupy(campaign, owner_of(store, bucket))
        plan = plan_download(store.objects(bucket), campaign, force=force)
        observer.planned(plan.count, plan.size)
        _Fetching(store, bucket, campaign, observer).fetch(plan)
    return DownloadResult(campaign, len(plan.runs), plan.present, plan.unfinished, plan.size)


def plan_download(
    objects: Iterable[StoredObject], campaign: Path, *, force: bool = False
) -> DownloadPlan:
    """What is to be fetched of the objects of a bucket.

    Raises:
        StorageError: an object's name leaves the folder.
    """
    runs: dict[str, list[StoredObject]] = {}
    files: list[StoredObject] = []
    for item in objects:
        run = _run_of(item.key)
        if run:
            runs.setdefault(run, []).append(item)
        elif force or not _is_here(item, campaign / item.key):
            files.append(item)
    wanted, unfinished, present = [], [], 0
    for path, parts in runs.items():
        record = next((item for item in parts if item.key == f"{path}/{RUN_RECORD}"), None)
        if record is None:
            unfinished.append(path)
        elif not force and _is_here(record, campaign / record.key):
            present += 1
        else:
            wanted.append(RunObjects(path, tuple(parts)))
    return DownloadPlan(tuple(wanted), tuple(files), present, tuple(unfinished))


def _run_of(key: str) -> str | None:
    """The run that an object belongs to; None when it belongs to none."""
    parts = PurePosixPath(key).parts
    if not parts or str(PurePosixPath(key)) != key or key.startswith("/") or ".." in parts:
        raise StorageError(f"the bucket has an object whose name is no path in a folder: {key!r}")
    is_run = len(parts) > 2 and not parts[0].startswith(("_", ".")) and parts[1].isdigit()
    return f"{parts[0]}/{parts[1]}" if is_run else None


def _is_here(item: StoredObject, path: Path) -> bool:
    try:
        found = path.stat()
    except OSError:
        return False
    return found.st_size == item.size and int(found.st_mtime) == int(item.modified)


class _Stopped(Exception):  # noqa: N818 - no error: it ends a thread
    """Another file could not be fetched, or the user has stopped it."""


@dataclass
class _Pending:
    """A run of which files are still missing."""

    run: RunObjects
    left: int
    lock: Lock = field(default_factory=Lock)

    def count_down(self) -> bool:
        """One file more is here; True when it was the last."""
        with self.lock:
            self.left -= 1
            return not self.left


class _Fetching:
    """Fetches files in several threads, and moves each run that is complete into its place."""

    def __init__(
        self, store: ObjectStore, bucket: str, campaign: Path, observer: DownloadObserver
    ) -> None:
        self._store = store
        self._bucket = bucket
        self._campaign = campaign
        self._observer = observer
        self._lock = Lock()
        self._stop = Event()

    def fetch(self, plan: DownloadPlan) -> None:
        """Fetch all; after a fault what is in progress is ended, and continued another time."""
        with ThreadPoolExecutor(THREADS, "download") as pool:
            tasks = [pool.submit(task) for task in self._tasks(plan)]
            try:
                for task in as_completed(tasks):
                    task.result()
            except BaseException:
                self._stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
                raise

    def _tasks(self, plan: DownloadPlan) -> Iterator[Callable[[], None]]:
        for item in plan.files:
            yield lambda item=item: self._get(item, self._campaign / item.key)  # type: ignore[misc]
        for run in plan.runs:
            pending = _Pending(run, len(run.objects))
            for item in run.objects:
                yield lambda item=item, pending=pending: self._get_part(item, pending)  # type: ignore[misc]

    def _get_part(self, item: StoredObject, pending: _Pending) -> None:
        self._get(item, self._campaign / STAGE / item.key)
        if pending.count_down():
            self._place(pending.run)

    def _get(self, item: StoredObject, target: Path) -> None:
        if STAGE in target.parts and _is_here(item, target):
            self._received(item.size)
        else:
            self._store.get_file(self._bucket, item, target, self._received)
        with self._lock:
            self._observer.file_finished()

    def _received(self, size: int) -> None:
        if self._stop.is_set():
            raise _Stopped
        with self._lock:
            self._observer.received(size)

    def _place(self, run: RunObjects) -> None:
        """Move a complete run to its place."""
        stage, target = self._campaign / STAGE / run.path, self._campaign / run.path
        expected = {self._campaign / STAGE / item.key for item in run.objects}
        for path in [path for path in stage.rglob("*") if path.is_file() and path not in expected]:
            path.unlink()  # of a run that was repeated since
        _link_job(stage)
        put_in_place(stage, target, replace=True)


def _link_job(run: Path) -> None:
    """Restore what S3 cannot hold: the link to the job that executed the run."""
    target, link = job_link(run / RUN_RECORD), run / "job"
    if target is not None and not os.path.lexists(link):
        link.symlink_to(target)


def job_link(record: Path) -> Path | None:
    """Where the link `job` of a run leads to; None when its record does not say."""
    try:
        job = json.loads(record.read_text(encoding="utf-8"))["job"]
    except (ValueError, TypeError, KeyError):
        return None  # a record of another version; the files are all here
    named = isinstance(job, str) and _JOB.fullmatch(job)
    return Path("..", "..", "_jobs", job) if named else None


@contextlib.contextmanager
def _explained(campaign: Path) -> Iterator[None]:
    try:
        yield
    except RobovastError as error:
        raise type(error)(
            f"{error} What was fetched stays; repeat the command to go on."
        ) from error
    except OSError as error:
        raise StorageError(
            f"{campaign}: cannot be written: {error.strerror} ({error.filename}). What was "
            "fetched stays; repeat the command to go on."
        ) from error
