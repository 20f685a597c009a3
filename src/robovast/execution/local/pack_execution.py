"""Executes one job: starts it, watches its runs, stores each when it ends."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import Popen
from threading import Event

from robovast.base import safe_paths
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending
from robovast.campaign.layout import JOBS, LOGS, RUNNING, SYSTEM_LOG, Layout, parameters_key
from robovast.campaign.records import EndedRun
from robovast.campaign.run_record import RunRecord
from robovast.execution.job_config import build_config_folder, is_pack, parameter_documents
from robovast.execution.local.process_tree import wait
from robovast.execution.local.runtime import Runtime, StartSpec
from robovast.execution.local.session import COMMON, Session
from robovast.execution.local.store import storage_errors, store_run
from robovast.execution.progress import PackOutput, keep_the_rest
from robovast.execution.watch import PackWatch
from robovast.model.plan import PackStart, Run

GRACE = 10.0
"""Time for a job to end by itself after a request [s]."""

_CONSOLE = "console.log"
"""Messages of the runtime itself, in the job's work folder."""

Started = Callable[[Run], None]
Finished = Callable[[Run, RunRecord], None]


@dataclass
class _Process:
    """What the runtime has started for a job."""

    runtime: Runtime
    spec: StartSpec
    stopping: Event
    popen: Popen[bytes]
    stopwatch: Stopwatch = field(default_factory=Stopwatch)

    def started(self) -> Stopwatch:
        return self.stopwatch

    def ending(self) -> Ending | None:
        code = self.popen.poll()
        return None if code is None else Ending(code)

    def is_interrupted(self) -> bool:
        return self.stopping.is_set()

    def stop(self) -> int | None:
        if self.popen.poll() is None:
            self.runtime.stop(self.spec, self.popen, GRACE)
        return self.popen.poll()

    def wait(self, seconds: float) -> None:
        wait(self.popen, seconds)


class PackExecution:
    """One execution of a job in its own work folder."""

    def __init__(
        self, session: Session, job: PackStart, stop: Event, started: Started, finished: Finished
    ) -> None:
        self._session = session
        self._job = job
        self._stop = stop
        self._started = started
        self._finished = finished
        self._work = session.layout.running / job.name
        self._spec = session.spec(job, self._work)
        self._console = self._work / _CONSOLE
        self._keys = session.keys(job)

    def execute(self) -> tuple[Run, ...]:
        """Execute the job; return the runs that were not started.

        Raises:
            StorageError: results cannot be stored.
        """
        with storage_errors(self._session.layout.root):
            self._prepare()
            watch = self._watch()
            try:
                ending = watch.follow()
            finally:
                self._session.runtime.clean_up(self._spec)
            last = watch.finish(ending)
            if last is not None:
                self._store(last)
            self._keep_the_rest()
        return watch.left

    def _watch(self) -> PackWatch:
        """Start the job."""
        runtime, spec = self._session.runtime, self._spec
        self._started(self._job.runs[0])
        process = _Process(runtime, spec, self._stop, runtime.start(spec, self._console))
        output = PackOutput(spec.out, spec.job, spec.job, self._console)
        timeout = self._session.document.vast.execution.timeout

        def run_over(ended: EndedRun) -> None:
            self._store(ended)
            self._started(watch.left[0])

        watch = PackWatch(process, self._job, output, self._work / "stored", timeout, run_over)
        return watch

    def _store(self, ended: EndedRun) -> None:
        self._finished(ended.run, store_run(self._session, ended, self._keys[ended.run.id]))

    def _prepare(self) -> None:
        _remove(self._work, self._work.parent)
        common = self._session.layout.running / COMMON
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

    def _keep_the_rest(self) -> None:
        """Store the job's output outside of runs, then remove the work folder."""
        out, own = self._spec.out, self._spec.job
        for name in (JOBS, RUNNING):
            _remove(out / name, out)
        keep_the_rest(out, own)
        console, log = self._console, own / SYSTEM_LOG
        if not safe_paths.is_file(log, own) and console.is_file():
            safe_paths.move(console, self._work, safe_paths.unused(log, own), own)
        _remove(self._work, self._work.parent)


def _remove(path: Path, root: Path) -> None:
    """Remove a path as far as possible; files of other users may remain."""
    with suppress(OSError):
        safe_paths.remove(path, root)
