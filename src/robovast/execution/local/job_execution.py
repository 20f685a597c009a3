"""Executing one job: start it, watch its runs, store each as it ends."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from subprocess import Popen
from threading import Event

from robovast.execution.job_config import build_config_folder, is_pack, parameter_documents
from robovast.execution.judge import Ending, judge
from robovast.execution.local.process_tree import wait
from robovast.execution.local.session import Session
from robovast.execution.local.store import explained, store_run
from robovast.execution.progress import is_over, keep_the_rest
from robovast.plan import Job, Run
from robovast.results.run_record import RunRecord
from robovast.results.verdict import read_test_result

POLL = 0.1
"""How often a job is looked at while it runs [s]; its end is noticed at once."""
GRACE = 10.0
"""How long a job may take to end by itself when it is told to [s]."""

Started = Callable[[Run], None]
Finished = Callable[[Run, RunRecord], None]


class JobExecution:
    """One execution of a job, in a work folder of its own."""

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
        self._current = 0
        """Index of the run that is being executed."""
        self._since = 0.0
        """When it began [s since the epoch]."""

    def execute(self) -> tuple[Run, ...]:
        """Execute the job; returns the runs that it never came to.

        Raises:
            StorageError: results cannot be stored.
        """
        with explained(self._session.layout.root):
            self._prepare()
        self._begin(0)
        process = self._session.runtime.start(self._spec, self._work / "console.log")
        try:
            ending = self._watch(process)
        finally:
            self._session.runtime.clean_up(self._spec)
        if not ending.from_outside:
            self._advance()
        if self._current == 0 or self._folder(self._job.runs[self._current]).is_dir():
            self._store(ending)
            self._current += 1
        with explained(self._session.layout.root):
            self._keep_the_rest()
        return self._job.runs[self._current :]

    def _prepare(self) -> None:
        shutil.rmtree(self._work, ignore_errors=True)
        common = self._session.layout.running / "common"
        build_config_folder(self._spec.config, common, self._job, self._session.scenario)
        parameters = self._session.layout.transient / f"{self._job.name}.params.yaml"
        parameters.write_text(parameter_documents(self._job, self._session.scenario), "utf-8")
        (self._spec.job / "logs").mkdir(parents=True, exist_ok=True)
        self._make_mount_point()
        folders = [
            self._spec.out,
            self._spec.out / "_jobs",
            self._spec.job,
            self._spec.job / "logs",
        ]
        if not is_pack(self._job):
            run = self._folder(self._job.runs[0])
            run.mkdir(parents=True)
            folders += [run, run.parent]
        self._give_to_user(folders)

    def _make_mount_point(self) -> None:
        """Where a run finds the job's own folder below `/out`."""
        mount_point = self._spec.out / "_jobs" / self._job.name
        if self._session.runtime.out_dir is None:
            mount_point.parent.mkdir(parents=True)
            mount_point.symlink_to(self._spec.job)
        else:  # the daemon would make it as root
            mount_point.mkdir(parents=True)

    def _give_to_user(self, folders: list[Path]) -> None:
        """Let the container's user write where it must."""
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
            if timeout is not None and time.time() - self._since > timeout:
                self._session.runtime.stop(self._spec, process, GRACE)
                return Ending(process.poll(), timed_out=True)
        return Ending(process.poll())

    def _advance(self) -> None:
        """Store the runs of a pack that are over; the last one is left to the job's end."""
        while self._current < len(self._job.runs) - 1 and is_over(
            self._job.runs, self._current, self._spec.out, self._spec.job
        ):
            self._store(Ending(None))
            self._begin(self._current + 1)

    def _begin(self, index: int) -> None:
        self._current = index
        self._since = time.time()
        self._started(self._job.runs[index])

    def _store(self, ending: Ending) -> None:
        run = self._job.runs[self._current]
        folder = self._folder(run)
        log = self._spec.job / "logs" / "system.log"
        if not log.is_file():
            log = self._work / "console.log"
        timeout = self._session.document.vast.execution.timeout
        result = judge(read_test_result(folder), ending, timeout, log)
        observed = (self._since, time.time())
        record = store_run(
            self._session, self._job, run, folder, result, observed, ending.exit_code
        )
        self._finished(run, record)

    def _folder(self, run: Run) -> Path:
        return self._spec.out / run.path

    def _keep_the_rest(self) -> None:
        """Keep what the job wrote outside its runs' folders, then remove the work folder."""
        shutil.rmtree(self._spec.out / "_jobs", ignore_errors=True)
        (self._spec.out / ".running").unlink(missing_ok=True)
        keep_the_rest(self._spec.out, self._spec.job)
        console, log = self._work / "console.log", self._spec.job / "logs" / "system.log"
        if not log.is_file() and console.is_file():
            shutil.move(console, log)
        shutil.rmtree(self._work, ignore_errors=True)
