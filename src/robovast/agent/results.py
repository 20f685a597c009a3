"""What an agent brings to the bucket: runs that are over, and the jobs that executed them."""

from __future__ import annotations

import os
import shutil
import socket
import time
from io import BytesIO
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.agent.claims import claim_job
from robovast.agent.pack import Pack, PodJob
from robovast.agent.trees import open_files, store_tree
from robovast.agent.watch import EndedRun
from robovast.cluster.storage import PART
from robovast.containers import named_digest
from robovast.execution.record import Circumstances, make_record
from robovast.results.layout import RUN_RECORD
from robovast.results.verdict import Verdict

RUNTIME = "kubernetes"
"""As run.json names it."""

SNAPSHOT_INTERVAL = 30.0
"""How often, at most, the logs of a job that goes on are stored, lest a lost pod takes them [s]."""

_OWN_NAMES = frozenset({RUN_RECORD, "job"})
"""What a run's folder has beside what the run wrote."""


class Results:
    """Stores what one pod leaves; every method may be called again after a failure.

    Every method raises `StorageError` when the server refuses, or is gone for too long.
    """

    def __init__(self, bucket: Bucket, pack: Pack) -> None:
        self._bucket = bucket
        self._pack = pack
        self._host = os.environ.get("NODE_NAME") or socket.gethostname()
        self._names: dict[int, str] = {}
        self._next_snapshot = 0.0

    def store_run(self, ended: EndedRun) -> Verdict:
        """Store a run that is over, and remove its folder.

        Returns:
            The verdict that is stored: that of another pod, when it was there before.
        """
        circumstances = Circumstances(
            campaign=self._pack.campaign,
            attempt=self._pack.attempt,
            job=self._name(ended.job),
            runtime=RUNTIME,
            image=self._pack.image,
            image_digest=named_digest(self._pack.image),
            host=self._host,
        )
        record = make_record(
            ended.run, ended.result, ended.observed, ended.exit_code, circumstances
        )
        verdict = self._store(ended, record.verdict, record.to_json().encode())
        shutil.rmtree(ended.folder, ignore_errors=True)
        return verdict

    def _store(self, ended: EndedRun, verdict: Verdict, text: bytes) -> Verdict:
        name, store, run = self._bucket.name, self._bucket.store, ended.run.path
        prefix = f"{run}/"
        key = prefix + RUN_RECORD
        there = {item.key for item in store.objects(name, prefix)}
        earlier = self._bucket.record(run) if key in there else None
        if earlier is not None and earlier.attempt >= self._pack.attempt:
            return earlier.verdict
        self._store_files(ended, prefix, there)
        if key not in there:
            if store.create(name, key, text):
                return verdict
            # Another pod executed this run at the same time, and has just stored it. Files of both
            # may be there; its are complete, so that ours can replace them as a whole.
            self._store_files(ended, prefix, {item.key for item in store.objects(name, prefix)})
        store.put_bytes(name, key, text)
        return verdict

    def _store_files(self, ended: EndedRun, prefix: str, there: set[str]) -> None:
        """Store what a run wrote, and remove what else is there."""
        keys = store_tree(self._bucket, ended.folder, prefix, there=there, skipped=_OWN_NAMES)
        self._bucket.store.delete(self._bucket.name, there - keys - {prefix + RUN_RECORD})

    def store_job(self, job: PodJob, folder: Path) -> None:
        """Store what a job that is over left beside its runs, and remove its folder."""
        prefix = f"_jobs/{self._name(job)}/"
        there = {item.key for item in self._bucket.store.objects(self._bucket.name, prefix)}
        store_tree(self._bucket, folder, prefix, there=there)
        shutil.rmtree(folder, ignore_errors=True)

    def store_snapshot(self, job: PodJob, folder: Path) -> None:
        """Store the small files of a job that goes on, now and then."""
        if time.monotonic() < self._next_snapshot:
            return
        prefix = f"_jobs/{self._name(job)}/"
        for path, file in open_files(folder):
            with file:
                content = file.read(PART + 1)
            if len(content) <= PART:
                self._bucket.store.put(self._bucket.name, prefix + path, BytesIO(content))
        self._next_snapshot = time.monotonic() + SNAPSHOT_INTERVAL

    def _name(self, job: PodJob) -> str:
        """Name of a job in the bucket: `fetch` has claimed the pod's first one."""
        if job.index == 1:
            return job.name
        if job.index not in self._names:
            number = claim_job(self._bucket, self._pack, job)
            self._names[job.index] = self._pack.job_name(number)
        return self._names[job.index]
