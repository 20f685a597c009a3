"""Watching a job, here or in a pod: each of its runs is handed over as soon as it is over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending, judge
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import Verdict, read_test_result
from robovast.execution.progress import JobOutput
from robovast.model.plan import Job, Run

POLL = 0.1
"""How often a job is looked at [s]."""


class Process(Protocol):
    """What executes a job."""

    def started(self) -> Stopwatch | None:
        """How long it has executed the job; None when it has not begun."""

    def ending(self) -> Ending | None:
        """How it has ended by itself; None when it did not."""

    def is_interrupted(self) -> bool:
        """True when somebody else ends it, or it cannot be executed."""

    def stop(self) -> int | None:
        """End it; returns its exit code, if there is one."""

    def wait(self, seconds: float) -> None:
        """Wait so long, or less when it ends in between."""


def final_ending(
    ended: Ending | None, interrupted: bool, seconds: float, timeout: int | None
) -> Ending | None:
    """How a job has ended, or, when that is from outside, is to be ended; None while it goes on.

    Args:
        ended: how it has ended by itself, if it did.
        interrupted: whether somebody else ends it.
        seconds: how long its current run takes already [s].
        timeout: the document's limit of that [s].
    """
    if interrupted:
        return Ending(None, interrupted=True)
    if ended is None and timeout is not None and seconds > timeout:
        return Ending(None, timed_out=True)
    return ended


@dataclass
class JobWatch:
    """Follows one job from its start to its end."""

    process: Process
    """Executes the job."""
    job: Job
    output: JobOutput
    stored: Path
    """Folder for runs that are over, out of the job's reach."""
    timeout: int | None
    """Of one run [s]."""
    run_over: Callable[[EndedRun], None]
    """Takes each run that is over while the job goes on."""
    _current: int = 0
    """Index of the run that is being executed."""
    _stopwatch: Stopwatch | None = None
    """Of that run, once it has begun."""

    @property
    def left(self) -> tuple[Run, ...]:
        """The runs that were not handed over, the current one first."""
        return self.job.runs[self._current :]

    def follow(self) -> Ending:
        """Follow the job until it has ended; its last run is left to `finish`."""
        while (ending := self._look()) is None:
            self.process.wait(POLL)
        return replace(ending, exit_code=self.process.stop()) if ending.from_outside else ending

    def finish(self, ending: Ending) -> EndedRun | None:
        """The current run of a job that has ended; None when that had not begun."""
        if self._current and not self.output.has_begun(self.job.runs[self._current]):
            return None
        return self._take(ending)

    def _look(self) -> Ending | None:
        """Hand over what is over, in an order in which nothing that comes meanwhile is missed."""
        ended = self.process.ending()
        interrupted = self.process.is_interrupted()
        while self._is_over():
            self.run_over(self._take(Ending(None)))
            self._stopwatch = Stopwatch()
        self._stopwatch = self._stopwatch or self.process.started()
        seconds = self._stopwatch.seconds if self._stopwatch else 0.0
        return final_ending(ended, interrupted, seconds, self.timeout)

    def _is_over(self) -> bool:
        """True when the current run is over; the last one is left to the job's end."""
        runs = self.job.runs
        if self._current == len(runs) - 1 or not self.output.is_over(runs, self._current):
            return False
        # Who interrupts a job says so before its run can write what comes of that.
        return not self.process.is_interrupted() or self._has_passed()

    def _has_passed(self) -> bool:
        out = self.output.out
        return read_test_result(out / self.left[0].path, out).verdict is Verdict.PASSED

    def _take(self, ending: Ending) -> EndedRun:
        """Move the current run to where no other run reaches it, and judge what is there."""
        run = self.left[0]
        folder = self.output.take(run, self.stored)
        self._current += 1
        result = judge(read_test_result(folder), ending, self.timeout, self.output.log_end())
        period = (self._stopwatch or Stopwatch()).period
        return EndedRun(self.job, run, folder, result, period, ending.exit_code)
