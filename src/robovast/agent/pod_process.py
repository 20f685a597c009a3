"""Watches a job in the main container of a pod."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.pack import PodStart
from robovast.agent.silent_runs import Silence
from robovast.base import safe_paths
from robovast.base.backoff import wait_until
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending
from robovast.campaign.layout import JOBS, RUNNING, SYSTEM_LOG, Layout
from robovast.campaign.records import EndedRun
from robovast.execution.progress import PackOutput, keep_the_rest
from robovast.execution.watch import POLL, PackWatch
from robovast.model.plan import Run

START_PATIENCE = 300.0
"""Time limit for the start of a run's container; its image is on the node already [s]."""
STOP_PATIENCE = 30.0
"""Time limit for the end of a job after a request, and of its secondary containers [s]."""
GONE_INTERVAL = 1.0
"""How often to look whether the run's container was killed, which takes longer than others [s]."""
PAUSE = 0.5
"""Longest time between two looks at a job [s]."""
KILL_DELAY = 2.0
"""Time to wait whether the whole pod is being killed, before the run is judged [s]."""
KILLED = 137
"""Exit code of a killed container, e.g. by the kernel when memory runs out."""

_NOT_OUTPUT = frozenset({".job", RUNNING, JOBS})


class Receiver(Protocol):
    """Receives the output of a job."""

    def run_over(self, ended: EndedRun) -> None:
        """A run is finished, its job continues."""

    def job_over(self, job: PodStart, folder: Path, last: EndedRun | None) -> None:
        """A job is finished: its output outside of runs, and its last run."""

    def goes_on(self, job: PodStart) -> None:
        """A job goes on, as each look finds; raise the error of something that was received."""


@dataclass
class PodProcess:
    """A job that the main container executes; communication is by files only."""

    container: RunContainer
    job: int
    """Its number."""
    is_stopping: Callable[[], bool]
    """Whether the agent was asked to end."""
    check: Callable[[], None]
    """Is called repeatedly while the job runs; an exception ends the watch."""
    _ordered: float = field(default_factory=time.monotonic)
    _stopwatch: Stopwatch | None = None
    _next_look: float = 0.0

    def started(self) -> Stopwatch | None:
        """Stopwatch since the start of the job; None before that."""
        ago = time.monotonic() - self._ordered
        self._stopwatch = self._stopwatch or self.container.started(self.job, ago)
        return self._stopwatch

    def ending(self) -> Ending | None:
        """How it ended by itself; None while it runs."""
        code = self.container.exit_code(self.job)
        if code is not None:
            return Ending(code, lacked_memory=self.container.lacked_memory(self.job))
        if self.started() is not None and self._is_gone():
            time.sleep(KILL_DELAY)
            return Ending(KILLED, container_killed=True)
        return None

    def is_interrupted(self) -> bool:
        """Whether the pod was asked to end, or the job does not start."""
        return self.is_stopping() or self.container.is_terminated() or self._never_starts()

    def _never_starts(self) -> bool:
        if self.started() is not None:
            return False
        return time.monotonic() > self._ordered + START_PATIENCE or self._is_gone()

    def _is_gone(self) -> bool:
        """Whether the container was killed, noticed within `GONE_INTERVAL`."""
        now = time.monotonic()
        if now < self._next_look:
            return False
        self._next_look = now + GONE_INTERVAL
        return self.container.is_gone(self.job)

    def stop(self) -> int | None:
        """Ask it to end; return its exit code, if there is one."""
        self.container.stop(self.job)
        self._wait_for(lambda: self.container.exit_code(self.job) is not None)
        return self.container.exit_code(self.job)

    def wait(self, seconds: float) -> None:
        """Wait for this time, or for a hundredth of that which the job has taken, up to `PAUSE`.

        Each look takes CPU that belongs to the run.
        """
        self.check()
        age = self._stopwatch.seconds if self._stopwatch else 0.0
        time.sleep(max(seconds, min(age / 100, PAUSE)))

    def wait_for_all(self, secondaries: Iterable[str]) -> None:
        """Wait until the job has ended in all secondary containers."""
        self._wait_for(lambda: self.container.all_over(self.job, secondaries))

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        wait_until(lambda: condition() or self.is_interrupted(), STOP_PATIENCE, POLL)


def follow_job(
    folders: Folders,
    job: PodStart,
    timeout: int | None,
    secondaries: tuple[str, ...],
    receiver: Receiver,
    is_stopping: Callable[[], bool],
    silence: Silence,
) -> tuple[Run, ...] | None:
    """Watch a job from its order to its end; return the runs that were not started.

    Returns None if this pod cannot continue.
    """
    output = PackOutput(folders.out, Layout(folders.out).job(job.name), folders.out)

    def check() -> None:
        receiver.goes_on(job)
        silence.look(lambda: output.own / SYSTEM_LOG)

    container, stored = RunContainer(folders), folders.stored / job.name
    process = PodProcess(container, job.index, is_stopping, check)
    watch = PackWatch(process, job, output, stored, timeout, receiver.run_over)
    ending = watch.follow()
    silence.end()
    if ending.interrupted:
        return None
    process.wait_for_all(secondaries)
    last = watch.finish(ending)
    receiver.job_over(job, _keep(folders, output, stored / "_job"), last)
    return None if watch.left and container.exit_code(job.index) is None else watch.left


def _keep(folders: Folders, output: PackOutput, kept: Path) -> Path:
    """Move the output of a finished job outside of runs out of the next job's reach."""
    safe_paths.make_folder(output.own, folders.out)  # the job may have removed it
    safe_paths.move(output.own, folders.out, kept, folders.work)
    keep_the_rest(folders.out, kept, but=_NOT_OUTPUT)
    return kept
