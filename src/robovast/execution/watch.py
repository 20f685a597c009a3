"""Watches a job, locally or in a pod, and passes on each of its runs when it has ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from robovast.base.stopwatch import Stopwatch
from robovast.campaign.job_log import own_part
from robovast.campaign.judge import Ending, judge
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import Verdict, read_test_result
from robovast.execution.progress import PackOutput
from robovast.model.plan import PackStart, Run

POLL = 0.1
"""Interval of checking a running job [s]."""


class WatchedProcess(Protocol):
    """A process that executes a job."""

    def started(self) -> Stopwatch | None:
        """Stopwatch since the start of the job; None before that."""

    def ending(self) -> Ending | None:
        """How it ended by itself; None while it runs."""

    def is_interrupted(self) -> bool:
        """Whether others end it, or the job cannot be started."""

    def stop(self) -> int | None:
        """End it; return its exit code, if there is one."""

    def wait(self, seconds: float) -> None:
        """Wait until it ends, at most for this time."""


def final_ending(
    ended: Ending | None, interrupted: bool, seconds: float, timeout: int | None
) -> Ending | None:
    """How a job ended, or why it must be ended now; None while it runs.

    Args:
        ended: how it ended by itself; None while it runs.
        interrupted: whether others end it.
        seconds: duration of its current run so far [s].
        timeout: the document's limit for one run [s].
    """
    if interrupted:
        return Ending(None, interrupted=True)
    if ended is None and timeout is not None and seconds > timeout:
        return Ending(None, timed_out=True)
    return ended


@dataclass
class PackWatch:
    """Watches one job from its start to its end."""

    process: WatchedProcess
    job: PackStart
    output: PackOutput
    stored: Path
    """Folder for finished runs that the job cannot access."""
    timeout: int | None
    """Time limit of one run [s]."""
    run_over: Callable[[EndedRun], None]
    """Receives each finished run while the job continues."""
    _current: int = 0
    """Index of the current run."""
    _log_begin: int = 0
    """Where the log of the run before ended [bytes]."""
    _stopwatch: Stopwatch | None = None
    """Stopwatch of the current run; None before its start."""

    @property
    def left(self) -> tuple[Run, ...]:
        """The runs that were not passed on, the current one first."""
        return self.job.runs[self._current :]

    def follow(self) -> Ending:
        """Watch the job until it has ended; `finish` returns its last run."""
        while (ending := self._look()) is None:
            self.process.wait(POLL)
        return replace(ending, exit_code=self.process.stop()) if ending.from_outside else ending

    def finish(self, ending: Ending) -> EndedRun | None:
        """The current run of a job that has ended; None if it was not started."""
        if self._current and not self.output.has_begun(self.job.runs[self._current]):
            return None
        return self._take(ending)

    def _look(self) -> Ending | None:
        """Pass on finished runs. The end is checked first, so that no earlier run is missed."""
        ended = self.process.ending()
        interrupted = self.process.is_interrupted()
        while self._is_over(ended):
            self.run_over(self._take(Ending(None)))
            self._stopwatch = Stopwatch()
        self._stopwatch = self._stopwatch or self.process.started()
        seconds = self._stopwatch.seconds if self._stopwatch else 0.0
        return final_ending(ended, interrupted, seconds, self.timeout)

    def _is_over(self, ended: Ending | None) -> bool:
        """Whether the current run, unless it is the last one, is finished.

        Where the driver cannot be used nobody says so, and results are written at the job's end.
        """
        if len(self.left) == 1:
            return False
        run = self.left[0]
        if not self.output.is_over(run) and (ended is None or not self.output.has_result(run)):
            return False
        # An interruption is announced before the run can write its consequences.
        return not self.process.is_interrupted() or self._has_passed()

    def _has_passed(self) -> bool:
        out = self.output.out
        return read_test_result(out / self.left[0].path, out).verdict is Verdict.PASSED

    def _take(self, ending: Ending) -> EndedRun:
        """Move the current run out of the job's reach, and determine its verdict there."""
        run = self.left[0]
        folder = self.output.take(run, self.stored)
        self._current += 1
        log, end = self.output.log_end(self._log_begin)
        self._log_begin = end - len(log) + own_part(log, run.path).stop
        result = judge(read_test_result(folder), ending, self.timeout, log, run.path)
        period = (self._stopwatch or Stopwatch()).period
        return EndedRun(self.job, run, folder, result, period, ending.exit_code)
