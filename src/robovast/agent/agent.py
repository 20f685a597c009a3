"""`agent`: prepares the runs of a pod, stores each that has ended, and reports at the end."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event

from robovast.agent.background import Background
from robovast.agent.bucket import Bucket
from robovast.agent.container_control import RunContainer
from robovast.agent.job_files import prepare_later_job
from robovast.agent.mounts import Folders
from robovast.agent.pack import Pack, PodStart, read_pack
from robovast.agent.pod_process import follow_job
from robovast.agent.preparation import prepare_apart
from robovast.agent.results import SNAPSHOT_INTERVAL, PodResults
from robovast.agent.silent_runs import SILENT, Silence
from robovast.agent.untrusted_files import SIDE_BY_SIDE
from robovast.base.errors import StorageError
from robovast.base.safe_paths import pinned
from robovast.base.signals import call_on_signals
from robovast.campaign.layout import JOBS
from robovast.campaign.records import EndedRun
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.exit_codes import AgentExit, exit_code_of
from robovast.kubeapi.pod_contract.messages import BAD_TOLD, BadRun, Verdicts
from robovast.kubeapi.pod_contract.pack_request import PackRequest
from robovast.kubeapi.pod_contract.storage_address import passed_address
from robovast.model.plan import PackStart
from robovast.storage.endpoint import Credentials
from robovast.storage.s3 import ObjectStore


def agent(folders: Folders, request: PackRequest, silence: float = 0.0) -> int:
    """Prepare the runs of a pod, and follow its jobs until every run has a verdict.

    Args:
        folders: of the pod.
        request: which runs.
        silence: how long a run may write nothing to its log until that is reported [s]; 0: never.

    Raises:
        KilledError: the process that prepares them was killed.
        StorageError: results cannot be stored.
        OSError: the pod's disk cannot be written.
    """
    container = RunContainer(folders)
    container.begin()
    stop = Event()
    try:
        with call_on_signals(stop.set):
            code = prepare_apart(folders, request, stop)
            return code or _follow(folders, container, silence, stop)
    finally:
        container.end()


def _follow(folders: Folders, container: RunContainer, silence: float, stop: Event) -> AgentExit:
    """Follow the jobs of a pod that are prepared; the first one is ordered already."""
    pack = read_pack(folders.pack)
    verdicts = dict(pack.done)
    bad: list[RunRecord] = []
    took: list[float] = []
    try:
        if pack.first is not None:
            credentials = Credentials.from_folder(folders.credentials)
            endpoint = passed_address()
            store = ObjectStore(endpoint, credentials, connections=SIDE_BY_SIDE + 2)
            with Background() as background:
                yielding = ObjectStore(
                    endpoint, credentials, patience=0, connections=1, stopped=background.is_busy
                )
                bucket = Bucket(store, pack.bucket, pack.owner)
                results = PodResults(bucket, pack, os.environ.get("POD_NAME", ""), yielding)
                keeper = _Keeper(folders, results, background, verdicts, bad, took)
                watched = Silence(folders.work / SILENT, silence)
                _follow_jobs(folders, pack, container, keeper, stop, watched)
        return _ending(pack, verdicts)
    finally:
        bad_runs = [BadRun.of(record) for record in bad]
        Verdicts.of(verdicts, _not_needed(pack, verdicts), took, bad_runs).write(folders.message)


def _not_needed(pack: Pack, verdicts: Mapping[int, Verdict]) -> int:
    """How many runs will never be executed, since the others have decided."""
    if pack.next_runs(verdicts):
        return 0
    return sum(run.id not in verdicts for run in pack.runs)


def _follow_jobs(
    folders: Folders,
    pack: Pack,
    container: RunContainer,
    keeper: _Keeper,
    stop: Event,
    silence: Silence,
) -> None:
    job = pack.first
    while job is not None:
        if job.index > 1:
            prepare_later_job(folders, pack, job)
            container.run(job.index)
        left = follow_job(
            folders, job, pack.timeout, pack.secondaries, keeper, stop.is_set, silence
        )
        if left is None:
            return
        keeper.wait()  # verdicts decide what is next, and what is stored makes room on the disk
        lost = [run for run in job.runs if run not in left and run.id not in keeper.verdicts]
        runs = left or pack.next_runs(keeper.verdicts)
        job = pack.job(job.index + 1, runs) if runs and not lost else None


def _ending(pack: Pack, verdicts: Mapping[int, Verdict]) -> AgentExit:
    if pack.next_runs(verdicts):
        return AgentExit.RUNS_LEFT
    return exit_code_of(verdicts.values())


class _Keeper:
    """Stores the output of a job while the job runs."""

    def __init__(
        self,
        folders: Folders,
        results: PodResults,
        background: Background,
        verdicts: dict[int, Verdict],
        bad: list[RunRecord],
        took: list[float],
    ) -> None:
        self._folders = folders
        self._results = results
        self._background = background
        self.verdicts = verdicts
        """Of the runs that are stored."""
        self._bad = bad
        self._took = took
        self._next_snapshot = time.monotonic() + SNAPSHOT_INTERVAL

    def run_over(self, ended: EndedRun) -> None:
        self._background.do(lambda: self._store_run(ended))

    def job_over(self, job: PodStart, folder: Path, last: EndedRun | None) -> None:
        """Store its last run first: its logs may take long, and are shown already, as far as known.

        Its logs are stored when none of them is being stored as it was before.
        """
        if last is not None:
            self._background.do(lambda: self._store_run(last))
        self._background.do(self._background.wait_for_side)
        self._background.do(lambda: self._results.store_job(job, folder))

    def goes_on(self, job: PodStart) -> None:
        self._background.check()
        if time.monotonic() >= self._next_snapshot:
            self._next_snapshot = math.inf
            self._background.do_aside(lambda: self._store_logs(job))

    def wait(self) -> None:
        """Wait until everything is stored."""
        self._background.wait()

    def _store_run(self, ended: EndedRun) -> None:
        began, finished = ended.observed
        self._took.append(max(0.0, finished - began))
        record = self._results.store_run(ended)
        self.verdicts[ended.run.id] = record.verdict
        if record.verdict in {Verdict.FAILED, Verdict.ERRORED} and len(self._bad) < BAD_TOLD:
            self._bad.append(record)

    def _store_logs(self, job: PodStart) -> None:
        """Store how far the logs of a job have come, for people who look at it meanwhile.

        They are stored again at its end; until then a run continues whether the server takes them.
        """
        try:
            self._output_of(job, self._results.store_logs)
        except (StorageError, OSError):
            pass
        finally:
            self._next_snapshot = time.monotonic() + SNAPSHOT_INTERVAL

    def _output_of(self, job: PackStart, store: Callable[[PackStart, Path], None]) -> None:
        """Store from the folder of a running job, if it exists, whatever takes its place."""
        jobs = self._folders.out / JOBS
        with (
            suppress(FileNotFoundError, NotADirectoryError),
            pinned(jobs, self._folders.out) as own,
        ):
            store(job, own / job.name)
