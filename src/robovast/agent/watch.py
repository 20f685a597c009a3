"""Watching one job of a pod: each of its runs is handed over as soon as it is over."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.pack import PodJob
from robovast.agent.silence import Silence
from robovast.base import safe_paths
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending, judge
from robovast.campaign.layout import JOBS, RUNNING, SYSTEM_LOG, Layout
from robovast.campaign.verdict import TestResult, Verdict, read_test_result
from robovast.execution.progress import JobOutput, keep_the_rest
from robovast.model.plan import Run

POLL = 0.1
"""How often a job is looked at [s]."""
START_PATIENCE = 300.0
"""How long the container of a run may take to start: its image is there already [s]."""
STOP_PATIENCE = 30.0
"""How long a job may take to end when that was ordered, and its secondary containers [s]."""
KILL_DELAY = 2.0
"""Who kills a whole pod kills the agent in this time; then it judges nothing [s]."""
KILLED = 137
"""Exit code of a container that was killed, as by the kernel when memory runs out."""

_NOT_OUTPUT = frozenset({".job", RUNNING, JOBS})


@dataclass(frozen=True)
class EndedRun:
    """A run that is over, out of its job's sight."""

    job: PodJob
    run: Run
    folder: Path
    """What it wrote; need not exist."""
    result: TestResult
    observed: tuple[float, float]
    """When it was seen to start and to end [s since the epoch]."""
    exit_code: int | None
    """Of its process; None when that goes on with other runs."""


class Receiver(Protocol):
    """Takes what a job leaves."""

    def run_over(self, ended: EndedRun) -> None:
        """A run is over, its job goes on."""

    def job_over(self, job: PodJob, folder: Path, last: EndedRun | None) -> None:
        """A job is over: what it left beside its runs, and the run that was its last."""

    def check(self) -> None:
        """Raise what went wrong with what was received."""


class JobWatch:
    """Follows one job from its order to its end."""

    def __init__(
        self,
        folders: Folders,
        job: PodJob,
        timeout: int | None,
        secondaries: tuple[str, ...],
        receiver: Receiver,
        is_stopping: Callable[[], bool],
        silence: Silence,
    ) -> None:
        self._folders = folders
        self._container = RunContainer(folders)
        self._job = job
        self._timeout = timeout
        self._secondaries = secondaries
        self._receiver = receiver
        self._is_stopping = is_stopping
        self._silence = silence
        self._output = JobOutput(folders.out, Layout(folders.out).job(job.name), folders.out)
        self._current = 0
        """Index of the run that is being executed."""
        self._stopwatch: Stopwatch | None = None
        """Of that run, once it has begun."""

    def follow(self) -> tuple[Run, ...] | None:
        """Follow the job to its end; returns the runs that it never came to.

        None when this pod cannot go on.
        """
        ending = self._wait()
        self._silence.end()
        if ending is None:
            return None
        if not ending.from_outside:
            self._advance()
        self._wait_for(lambda: self._container.all_over(self._job.index, self._secondaries))
        self._finish(ending)
        left = self._job.runs[self._current :]
        return None if left and self._container.exit_code(self._job.index) is None else left

    def _wait(self) -> Ending | None:
        """How the job ended; None when the pod is told to end, or its run never starts."""
        give_up = time.monotonic() + START_PATIENCE
        while True:
            self._receiver.check()
            self._advance()
            ending = self._ending()
            if self._is_interrupted():
                self._advance()
                return None
            if ending is not None:
                return ending
            if self._stopwatch is None and self._never_starts(give_up):
                return None
            self._silence.look(lambda: self._output.own / SYSTEM_LOG)
            time.sleep(POLL)

    def _never_starts(self, give_up: float) -> bool:
        return time.monotonic() > give_up or self._container.is_gone(self._job.index)

    def _ending(self) -> Ending | None:
        number, container = self._job.index, self._container
        if self._stopwatch is None:
            self._stopwatch = container.started(number)
        code = container.exit_code(number)
        if code is not None:
            return Ending(code, lacked_memory=container.lacked_memory(number))
        if self._stopwatch is not None and container.is_gone(number):
            time.sleep(KILL_DELAY)
            return Ending(KILLED, container_killed=True)
        if self._is_overdue():
            container.stop(number)
            self._wait_for(lambda: container.exit_code(number) is not None)
            return Ending(container.exit_code(number), timed_out=True)
        return None

    def _is_overdue(self) -> bool:
        if self._timeout is None or self._stopwatch is None:
            return False
        return self._stopwatch.seconds > self._timeout

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        give_up = time.monotonic() + STOP_PATIENCE
        while not condition() and not self._is_interrupted() and time.monotonic() < give_up:
            time.sleep(POLL)

    def _is_interrupted(self) -> bool:
        return self._is_stopping() or self._container.is_terminated()

    def _advance(self) -> None:
        """Hand over the runs that are over; the last one is left to the job's end."""
        runs = self._job.runs
        while self._current < len(runs) - 1 and self._output.is_over(runs, self._current):
            result = self._result()
            # Who tells a pod to end says so before its run can write what comes of that.
            if self._is_interrupted() and result.verdict is not Verdict.PASSED:
                return
            self._receiver.run_over(self._take(result, Ending(None)))
            self._current += 1
            self._stopwatch = Stopwatch()

    def _finish(self, ending: Ending) -> None:
        """Hand over the current run, when it has begun, and what the job left beside its runs."""
        last = None
        if self._current == 0 or self._output.has_begun(self._job.runs[self._current]):
            result = judge(self._result(), ending, self._timeout, self._output.log_end())
            last = self._take(result, ending)
            self._current += 1
        out, work = self._folders.out, self._folders.work
        kept = self._folders.stored / self._job.name / "_job"
        safe_paths.make_folder(self._output.own, out)  # the job may have removed it
        safe_paths.move(self._output.own, out, kept, work)
        keep_the_rest(out, kept, but=_NOT_OUTPUT)
        self._receiver.job_over(self._job, kept, last)

    def _result(self) -> TestResult:
        """What the current run says of itself."""
        out = self._folders.out
        return read_test_result(out / self._job.runs[self._current].path, out)

    def _take(self, result: TestResult, ending: Ending) -> EndedRun:
        """Move the current run to where no other run reaches it."""
        run = self._job.runs[self._current]
        folder = self._output.take(run, self._folders.stored / self._job.name)
        period = (self._stopwatch or Stopwatch()).period
        return EndedRun(self._job, run, folder, result, period, ending.exit_code)
