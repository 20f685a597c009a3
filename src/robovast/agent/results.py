"""Stores finished runs, and the jobs that executed them, in the bucket."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import BinaryIO

from robovast.agent.bucket import Bucket
from robovast.agent.claims import claim_job
from robovast.agent.pack import Pack
from robovast.agent.reusable_runs import make_offer
from robovast.agent.untrusted_files import open_files, store_files
from robovast.base import safe_paths
from robovast.base.containers import named_digest
from robovast.base.errors import StorageError
from robovast.campaign.checksums import recorded
from robovast.campaign.layout import JOBS, LOGS, SYSTEM_LOG
from robovast.campaign.object_keys import Keys
from robovast.campaign.records import Circumstances, EndedRun, copied_record, make_record
from robovast.campaign.reserved_names import set_own_names_aside
from robovast.campaign.run_files import MOST_LISTED, StoredFile, Writer, escaped
from robovast.campaign.run_record import RunRecord
from robovast.model.plan import PackStart, Run
from robovast.storage.s3 import ObjectStore

RUNTIME = "kubernetes"
"""Name of this runtime in run.json."""

SNAPSHOT_INTERVAL = 30.0
"""Shortest time between two snapshots of a running job's files, for those who look at it and in
case its pod is lost [s]."""
REFRESH = 100.0
"""When an unchanged, small log is stored again, whose time tells that its job runs [s]."""
SMALL = 2**20
"""Size up to which that is done [byte]."""

ROOM = 16 * 2**20
"""Most that one snapshot stores [byte]: of a log that is larger, the last part."""
LEAST = 2**16
"""Least part of a log that is stored [byte]."""
MOST_FILES = 100
"""Most files that one snapshot stores."""
PACE = 2**18
"""Most that the snapshots of a pod store on average [byte/s]."""

WRITERS = 20
"""Most other writers that may store the same run meanwhile."""

MISSING = "missing.json"
"""File in a job's folder that lists what could not be stored."""


class PodResults:
    """Stores the results of one pod; every method may be called again after a failure.

    Every method raises `StorageError` when the server refuses, or is gone for too long.
    """

    def __init__(
        self, bucket: Bucket, pack: Pack, pod: str, yielding: ObjectStore | None = None
    ) -> None:
        """
        Args:
            bucket: the campaign's.
            pack: of the pod.
            pod: name of the pod that executes the runs; empty when none does.
            yielding: the same server, for snapshots: it stops when results are to be stored.
        """
        self._bucket = bucket
        self._yielding = yielding or bucket.store
        self._pod = pod
        self._pack = pack
        self._host = os.environ.get("NODE_NAME") or socket.gethostname()
        self._names: dict[int, str] = {}
        self._claiming = Lock()
        self._next_snapshot = 0.0
        self._sent: dict[str, _Sent] = {}
        """By key of the current job's files: what the last snapshot of them stored."""
        self._begun: set[str] = set()
        """Where something of a job may be stored already: no other pod stores it."""

    def store_run(self, ended: EndedRun) -> RunRecord:
        """Store a finished run, and remove its folder.

        Returns:
            The stored record: that of another pod, if it stored the run before.
        """
        set_own_names_aside(ended.folder)
        return self._store(ended.run, ended.folder, lambda: self._record(ended))

    def store_copy(self, job: PackStart, run: Run, origin: RunRecord, folder: Path) -> RunRecord:
        """Store a run as another campaign has stored it, and remove the folder of its files.

        Args:
            job: the job that would have executed it.
            run: the run.
            origin: record of the other campaign's.
            folder: its files.

        Returns:
            The stored record, as `store_run` does.
        """
        executed = f"{origin.campaign}/{origin.variant}/{origin.run}"
        copied = copied_record(origin, executed, run, self._pack.campaign, self._name(job))
        record = replace(copied, attempt=self._pack.attempt)
        return self._store(run, folder, lambda: record)

    def _store(self, run: Run, folder: Path, made: Callable[[], RunRecord]) -> RunRecord:
        for _ in range(WRITERS):
            record = self._settled(run.path, folder, made)
            if record is not None:
                _remove(folder)
                return record
        raise StorageError(
            f"{run.path}: its record was replaced {WRITERS} times while it was stored",
            hint="check that the server supports conditional writes (If-Match)",
        )

    def _settled(self, run: str, folder: Path, made: Callable[[], RunRecord]) -> RunRecord | None:
        """The stored record; None if another writer came in between."""
        earlier, etag = self._bucket.seen(run)
        if earlier is not None and earlier.attempt >= self._pack.attempt:
            return earlier
        writer = Writer(run)

        def store(path: str, number: int, file: BinaryIO) -> StoredFile:
            key = writer.key(path, number)
            sent = self._bucket.store.put_new(self._bucket.name, f"{run}/{key}", file)
            return StoredFile(path, key, sent.size, sent.sha256)

        stored, missing = store_files(folder, store)
        files = self._bucket.store_list(writer, stored)
        record = replace(made(), files=files, missing=missing.first(MOST_LISTED))
        if record.key and not record.missing:
            record = replace(record, outputs=recorded({f.path: f.sha256 for f in stored}))
        if not self._bucket.settle(run, record, etag):
            return None
        make_offer(self._bucket.store, self._bucket.name, record)
        return record

    def _record(self, ended: EndedRun) -> RunRecord:
        circumstances = Circumstances(
            campaign=self._pack.campaign,
            attempt=self._pack.attempt,
            job=self._name(ended.job),
            runtime=RUNTIME,
            image=self._pack.image,
            image_digest=named_digest(self._pack.image),
            host=self._host,
            pod=self._pod,
            key=self._pack.keys_of(ended.job).get(ended.run.id, ""),
        )
        return make_record(ended, circumstances)

    def store_job(self, job: PackStart, folder: Path) -> None:
        """Store what a finished job left beside its runs, and remove its folder."""
        prefix = f"{JOBS}/{self._name(job)}/"
        listed = self._bucket.store.objects(self._bucket.name, prefix)
        there = Keys(item.key for item in (listed if prefix in self._begun else ()))
        self._begun.add(prefix)

        def store(path: str, _: int, file: BinaryIO) -> bool:
            return self._bucket.put(prefix + escaped(path), file, there)

        self._sent = {}
        _, missing = store_files(folder, store)
        if missing.first():
            text = json.dumps([file.data() for file in missing.first()], indent=1)
            self._bucket.store.put_bytes(self._bucket.name, prefix + MISSING, text.encode())
        _remove(folder)

    def store_logs(self, job: PackStart, folder: Path) -> None:
        """Store how far the logs and the other files of a running job have come.

        Files that have not changed are not stored again. Of a log without room, the last part is
        stored, and a first line says so.
        """
        if time.monotonic() < self._next_snapshot:
            return
        prefix = f"{JOBS}/{self._name(job)}/"
        self._begun.add(prefix)
        room, number = ROOM, 0
        for path, file in _files_of(folder):
            with file:
                state = os.fstat(file.fileno())
                now = _Sent(state.st_size, state.st_mtime_ns, time.monotonic())
                key, size = prefix + escaped(path), min(now.size, room)
                cut = size < now.size
                if (
                    not now.is_due(self._sent.get(key), path)
                    or (cut and (size < LEAST or not path.startswith(f"{LOGS}/")))
                    or number == MOST_FILES
                ):
                    continue
                if cut:
                    self._yielding.put_bytes(self._bucket.name, key, _last_part(file, size))
                else:
                    self._yielding.put_new(self._bucket.name, key, file)
                self._sent[key], room, number = now, room - size, number + 1
        self._next_snapshot = time.monotonic() + (ROOM - room) / PACE

    def _name(self, job: PackStart) -> str:
        """Name of a job in the bucket: the pod's first one was claimed before."""
        if job.index == 1:
            return job.name
        with self._claiming:
            if job.index not in self._names:
                number = claim_job(self._bucket, self._pack, job)
                self._names[job.index] = self._pack.job_name(number)
            return self._names[job.index]


@dataclass(frozen=True)
class _Sent:
    """A file that a snapshot stores."""

    size: int
    modified: int
    """[ns since the epoch]"""
    at: float
    """Time of the snapshot [s]."""

    def is_due(self, last: _Sent | None, path: str) -> bool:
        """Whether it is stored after a snapshot that stored it before."""
        if last is None or (self.size, self.modified) != (last.size, last.modified):
            return True
        return path == SYSTEM_LOG and self.size <= SMALL and self.at >= last.at + REFRESH


def _files_of(folder: Path) -> Iterator[tuple[str, BinaryIO]]:
    """The readable files of a running job, the log of the job first."""
    for is_first in (True, False):
        for path, file in open_files(folder):
            if isinstance(file, OSError):
                continue  # reported at the end of the job
            if (path == SYSTEM_LOG) is is_first:
                yield path, file
            else:
                file.close()


def _last_part(file: BinaryIO, size: int) -> bytes:
    """The last whole lines of a log [byte], and a first line that says so."""
    whole = os.fstat(file.fileno()).st_size
    part = os.pread(file.fileno(), size, whole - size)
    first, _, rest = part.partition(b"\n")
    kept = rest or first
    left_out = (
        f"... the first {whole - len(kept):,} bytes of this log are stored when its job ends\n"
    )
    return left_out.encode() + kept


def _remove(folder: Path) -> None:
    """Remove a folder to free space; what cannot be removed goes with the pod."""
    with suppress(OSError):
        safe_paths.remove(folder, folder.parent)
