"""A job in the main container of a pod, followed to its end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.pack import PodJob
from robovast.agent.silence import Silence
from robovast.base import safe_paths
from robovast.base.backoff import wait_until
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending
from robovast.campaign.layout import JOBS, RUNNING, SYSTEM_LOG, Layout
from robovast.campaign.records import EndedRun
from robovast.execution.progress import JobOutput, keep_the_rest
from robovast.execution.watch import POLL, JobWatch
from robovast.model.plan import Run

START_PATIENCE = 300.0
"""How long the container of a run may take to start: its image is there already [s]."""
STOP_PATIENCE = 30.0
"""How long a job may take to end when that was ordered, and its secondary containers [s]."""
KILL_DELAY = 2.0
"""Who kills a whole pod kills the agent in this time; then it judges nothing [s]."""
KILLED = 137
"""Exit code of a container that was killed, as by the kernel when memory runs out."""

_NOT_OUTPUT = frozenset({".job", RUNNING, JOBS})


class Receiver(Protocol):
    """Takes what a job leaves."""

    def run_over(self, ended: EndedRun) -> None:
        """A run is over, its job goes on."""

    def job_over(self, job: PodJob, folder: Path, last: EndedRun | None) -> None:
        """A job is over: what it left beside its runs, and the run that was its last."""

    def check(self) -> None:
        """Raise what went wrong with what was received."""


@dataclass
class PodProcess:
    """A job that was ordered of the main container; it is known by files alone."""

    container: RunContainer
    job: int
    """Its number."""
    is_stopping: Callable[[], bool]
    """Whether the agent was told to end."""
    check: Callable[[], None]
    """Is called now and then while the job goes on, which ends when this raises."""
    _give_up: float = field(default_factory=lambda: time.monotonic() + START_PATIENCE)
    _stopwatch: Stopwatch | None = None

    def started(self) -> Stopwatch | None:
        """How long it has executed the job."""
        self._stopwatch = self._stopwatch or self.container.started(self.job)
        return self._stopwatch

    def ending(self) -> Ending | None:
        """How it has ended by itself."""
        code = self.container.exit_code(self.job)
        if code is not None:
            return Ending(code, lacked_memory=self.container.lacked_memory(self.job))
        if self.started() is not None and self.container.is_gone(self.job):
            time.sleep(KILL_DELAY)
            return Ending(KILLED, container_killed=True)
        return None

    def is_interrupted(self) -> bool:
        """True when the pod is told to end, or the job never starts."""
        return self.is_stopping() or self.container.is_terminated() or self._never_starts()

    def _never_starts(self) -> bool:
        if self.started() is not None:
            return False
        return time.monotonic() > self._give_up or self.container.is_gone(self.job)

    def stop(self) -> int | None:
        """Order its end."""
        self.container.stop(self.job)
        self._wait_for(lambda: self.container.exit_code(self.job) is not None)
        return self.container.exit_code(self.job)

    def wait(self, seconds: float) -> None:
        """Wait so long."""
        self.check()
        time.sleep(seconds)

    def wait_for_all(self, secondaries: Iterable[str]) -> None:
        """Wait until it has ended in all secondary containers."""
        self._wait_for(lambda: self.container.all_over(self.job, secondaries))

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        wait_until(lambda: condition() or self.is_interrupted(), STOP_PATIENCE, POLL)


def follow_job(
    folders: Folders,
    job: PodJob,
    timeout: int | None,
    secondaries: tuple[str, ...],
    receiver: Receiver,
    is_stopping: Callable[[], bool],
    silence: Silence,
) -> tuple[Run, ...] | None:
    """Follow a job from its order to its end; returns the runs that it never came to.

    None when this pod cannot go on.
    """
    output = JobOutput(folders.out, Layout(folders.out).job(job.name), folders.out)

    def check() -> None:
        receiver.check()
        silence.look(lambda: output.own / SYSTEM_LOG)

    container, stored = RunContainer(folders), folders.stored / job.name
    process = PodProcess(container, job.index, is_stopping, check)
    watch = JobWatch(process, job, output, stored, timeout, receiver.run_over)
    ending = watch.follow()
    silence.end()
    if ending.interrupted:
        return None
    process.wait_for_all(secondaries)
    last = watch.finish(ending)
    receiver.job_over(job, _keep(folders, output, stored / "_job"), last)
    return None if watch.left and container.exit_code(job.index) is None else watch.left


def _keep(folders: Folders, output: JobOutput, kept: Path) -> Path:
    """Move what a job that is over left beside its runs to where no other job reaches it."""
    safe_paths.make_folder(output.own, folders.out)  # the job may have removed it
    safe_paths.move(output.own, folders.out, kept, folders.work)
    keep_the_rest(folders.out, kept, but=_NOT_OUTPUT)
    return kept
