"""Executes one job: starts it, watches its runs, stores each when it ends."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from subprocess import Popen
from threading import Event

from robovast.base import safe_paths
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending, judge
from robovast.campaign.layout import JOBS, LOGS, RUNNING, SYSTEM_LOG, Layout, parameters_key
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import read_test_result
from robovast.execution.job_config import build_config_folder, is_pack, parameter_documents
from robovast.execution.local.process_tree import wait
from robovast.execution.local.session import Session
from robovast.execution.local.store import explained, store_run
from robovast.execution.progress import JobOutput, end_of, keep_the_rest
from robovast.model.plan import Job, Run

POLL = 0.1
"""Interval of checking a running job [s]; its end is noticed at once."""
GRACE = 10.0
"""Time for a job to end by itself after a request [s]."""

_CONSOLE = "console.log"
"""Messages of the runtime itself, in the job's work folder."""

Started = Callable[[Run], None]
Finished = Callable[[Run, RunRecord], None]


class JobExecution:
    """One execution of a job in its own work folder."""

    def __init__(
        self, session: Session, job: Job, stop: Event, started: Started, finished: Finished
    ) -> None:
        self._session = session
        self._job = job
        self._stop = stop
        self._started = started
        self._finished = finished
        self._work = session.layout.running / job.name
        self._spec = session.spec(job, self._work)
        self._output = JobOutput(self._spec.out, self._spec.job, self._spec.job)
        self._current = 0
        """Index of the current run."""
        self._stopwatch = Stopwatch()
        """Stopwatch of the current run."""

    def execute(self) -> tuple[Run, ...]:
        """Execute the job; return the runs that were not started.

        Raises:
            StorageError: results cannot be stored.
        """
        with explained(self._session.layout.root):
            self._prepare()
        self._begin(0)
        process = self._session.runtime.start(self._spec, self._work / _CONSOLE)
        try:
            ending = self._watch(process)
        finally:
            self._session.runtime.clean_up(self._spec)
        if not ending.from_outside:
            self._advance()
        if self._current == 0 or self._output.has_begun(self._job.runs[self._current]):
            self._store(ending)
            self._current += 1
        with explained(self._session.layout.root):
            self._keep_the_rest()
        return self._job.runs[self._current :]

    def _prepare(self) -> None:
        _remove(self._work, self._work.parent)
        common = self._session.layout.running / "common"
        build_config_folder(self._spec.config, common, self._job, self._session.scenario)
        parameters = self._session.layout.root / parameters_key(self._job.name)
        parameters.write_text(parameter_documents(self._job, self._session.scenario), "utf-8")
        (self._spec.job / LOGS).mkdir(parents=True, exist_ok=True)
        self._make_mount_point()
        folders = [
            self._spec.out,
            self._spec.out / JOBS,
            self._spec.job,
            self._spec.job / LOGS,
        ]
        if not is_pack(self._job):
            run = self._spec.out / self._job.runs[0].path
            run.mkdir(parents=True)
            folders += [run, run.parent]
        self._give_to_user(folders)

    def _make_mount_point(self) -> None:
        """Create the mount point of the job's own folder below `/out`."""
        mount_point = Layout(self._spec.out).job(self._job.name)
        if self._session.runtime.out_dir is None:
            mount_point.parent.mkdir(parents=True)
            mount_point.symlink_to(self._spec.job)
        else:  # otherwise the daemon creates it as root
            mount_point.mkdir(parents=True)

    def _give_to_user(self, folders: list[Path]) -> None:
        """Let the container's user write to folders."""
        user = self._session.user_id
        if self._session.runtime.name == "process" or user == os.getuid():
            return
        for folder in folders:
            if os.getuid() == 0:
                os.chown(folder, user, user)
            else:
                folder.chmod(0o777)

    def _watch(self, process: Popen[bytes]) -> Ending:
        timeout = self._session.document.vast.execution.timeout
        while not wait(process, POLL):
            self._advance()
            if self._stop.is_set():
                self._session.runtime.stop(self._spec, process, GRACE)
                return Ending(process.poll(), interrupted=True)
            if timeout is not None and self._stopwatch.seconds > timeout:
                self._session.runtime.stop(self._spec, process, GRACE)
                return Ending(process.poll(), timed_out=True)
        return Ending(process.poll())

    def _advance(self) -> None:
        """Store the finished runs of a pack; the last one is stored at the job's end."""
        runs = self._job.runs
        while self._current < len(runs) - 1 and self._output.is_over(runs, self._current):
            self._store(Ending(None))
            self._begin(self._current + 1)

    def _begin(self, index: int) -> None:
        self._current = index
        self._stopwatch = Stopwatch()
        self._started(self._job.runs[index])

    def _store(self, ending: Ending) -> None:
        run = self._job.runs[self._current]
        with explained(self._session.layout.root):
            folder = self._output.take(run, self._work / "stored")
        log = self._output.log_end() or end_of(self._work / _CONSOLE, self._work)
        timeout = self._session.document.vast.execution.timeout
        result = judge(read_test_result(folder), ending, timeout, log)
        observed = self._stopwatch.period
        record = store_run(
            self._session, self._job, run, folder, result, observed, ending.exit_code
        )
        self._finished(run, record)

    def _keep_the_rest(self) -> None:
        """Store the job's output outside of runs, then remove the work folder."""
        out, own = self._spec.out, self._spec.job
        for name in (JOBS, RUNNING):
            _remove(out / name, out)
        keep_the_rest(out, own)
        console, log = self._work / _CONSOLE, own / SYSTEM_LOG
        if not safe_paths.is_file(log, own) and console.is_file():
            safe_paths.move(console, self._work, safe_paths.unused(log, own), own)
        _remove(self._work, self._work.parent)


def _remove(path: Path, root: Path) -> None:
    """Remove a path as far as possible; files of other users may remain."""
    with suppress(OSError):
        safe_paths.remove(path, root)
