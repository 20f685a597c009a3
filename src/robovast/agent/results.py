"""Stores finished runs, and the jobs that executed them, in the bucket."""

from __future__ import annotations

import json
import os
import socket
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from robovast.agent.bucket import Bucket
from robovast.agent.claims import claim_job
from robovast.agent.pack import Pack
from robovast.agent.untrusted_files import open_files, store_files
from robovast.base import safe_paths
from robovast.base.containers import named_digest
from robovast.campaign.layout import JOBS
from robovast.campaign.own_names import set_own_names_aside
from robovast.campaign.places import Keys
from robovast.campaign.records import Circumstances, EndedRun, make_record
from robovast.campaign.run_files import MOST_TOLD, StoredFile, Writer, escaped
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.plan import PackStart

RUNTIME = "kubernetes"
"""Name of this runtime in run.json."""

SNAPSHOT_INTERVAL = 30.0
"""Shortest time between two snapshots of a running job's logs, for the case of a lost pod [s]."""

SMALL = 16 * 2**20
"""Largest file of a running job that is stored in a snapshot [byte]."""

MISSING = "missing.json"
"""File in a job's folder that lists what could not be stored."""


class Results:
    """Stores the results of one pod; every method may be called again after a failure.

    Every method raises `StorageError` when the server refuses, or is gone for too long.
    """

    def __init__(self, bucket: Bucket, pack: Pack, pod: str) -> None:
        """
        Args:
            bucket: the campaign's.
            pack: of the pod.
            pod: name of the pod that executes the runs; empty when none does.
        """
        self._bucket = bucket
        self._pod = pod
        self._pack = pack
        self._host = os.environ.get("NODE_NAME") or socket.gethostname()
        self._names: dict[int, str] = {}
        self._next_snapshot = 0.0

    def store_run(self, ended: EndedRun) -> Verdict:
        """Store a finished run, and remove its folder.

        Returns:
            The stored verdict: that of another pod, if it stored the run before.
        """
        set_own_names_aside(ended.folder)
        verdict = self._settled(ended)
        while verdict is None:
            verdict = self._settled(ended)
        _remove(ended.folder)
        return verdict

    def _settled(self, ended: EndedRun) -> Verdict | None:
        """The stored verdict; None if another writer came in between."""
        run = ended.run.path
        earlier, etag = self._bucket.seen(run)
        if earlier is not None and earlier.attempt >= self._pack.attempt:
            return earlier.verdict
        writer = Writer(run)

        def store(path: str, number: int, file: BinaryIO) -> StoredFile:
            key = writer.key(path, number)
            sent = self._bucket.store.put_new(self._bucket.name, f"{run}/{key}", file)
            return StoredFile(path, key, sent.size, sent.sha256)

        stored, missing = store_files(ended.folder, store)
        files = self._bucket.store_list(writer, stored)
        record = replace(self._record(ended), files=files, missing=missing.told(MOST_TOLD))
        return record.verdict if self._bucket.settle(run, record, etag) else None

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
        )
        return make_record(ended, circumstances)

    def store_job(self, job: PackStart, folder: Path) -> None:
        """Store what a finished job left beside its runs, and remove its folder."""
        prefix = f"{JOBS}/{self._name(job)}/"
        there = Keys(item.key for item in self._bucket.store.objects(self._bucket.name, prefix))

        def store(path: str, _: int, file: BinaryIO) -> bool:
            return self._bucket.put(prefix + escaped(path), file, there)

        _, missing = store_files(folder, store)
        if missing.told():
            told = json.dumps([file.data() for file in missing.told()], indent=1)
            self._bucket.store.put_bytes(self._bucket.name, prefix + MISSING, told.encode())
        _remove(folder)

    def store_snapshot(self, job: PackStart, folder: Path) -> None:
        """Store the small files of a running job periodically."""
        if time.monotonic() < self._next_snapshot:
            return
        prefix = f"{JOBS}/{self._name(job)}/"
        for path, file in open_files(folder):
            if isinstance(file, OSError):
                continue  # it is told of at the end of the job
            with file:
                if os.fstat(file.fileno()).st_size <= SMALL:
                    self._bucket.store.put(self._bucket.name, prefix + escaped(path), file)
        self._next_snapshot = time.monotonic() + SNAPSHOT_INTERVAL

    def _name(self, job: PackStart) -> str:
        """Name of a job in the bucket: `fetch` has claimed the pod's first one."""
        if job.index == 1:
            return job.name
        if job.index not in self._names:
            number = claim_job(self._bucket, self._pack, job)
            self._names[job.index] = self._pack.job_name(number)
        return self._names[job.index]


def _remove(folder: Path) -> None:
    """Remove a folder to free space; what cannot be removed goes with the pod."""
    with suppress(OSError):
        safe_paths.remove(folder, folder.parent)
