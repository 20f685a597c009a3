"""Jobs that were made again under another name, which has their number. Pure functions.

A task ends, and its pod is deleted before the operator has read the result: a cleaner removes pods
at once, or the cluster keeps few of them. So another Job repeats the task, each after a longer
pause. The Job of a shard is made again when another cluster has not
executed all of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import parse_time

FIRST_PAUSE = timedelta(seconds=5)
"""Between the end of the first Job and the second; twice as long each further time."""
LONGEST_PAUSE = timedelta(minutes=10)
LOST_JOBS = 3
"""Number of Jobs with a lost message after which the problem is reported."""


def number_of(name: str, task: str) -> int | None:
    """Return the number of a task's Job by name (`finish-3` is 0, `finish-3-1` is 1); else None."""
    if name == task:
        return 0
    number = name.removeprefix(f"{task}-")
    is_number = number != name and number.isdecimal() and number.isascii() and len(number) < 6
    return int(number) if is_number else None


@dataclass(frozen=True)
class Tries:
    """The Jobs of a task, or of a shard."""

    task: str
    """Name of the first."""
    jobs: tuple[JobState, ...]
    """Those that are there, oldest first."""

    @classmethod
    def of(cls, jobs: Iterable[JobState], task: str) -> Tries:
        """Select the Jobs of a task from the Jobs of a campaign."""
        mine = [job for job in jobs if number_of(job.name, task) is not None]
        return cls(task, tuple(sorted(mine, key=lambda job: number_of(job.name, task) or 0)))

    @property
    def last(self) -> JobState | None:
        """Return the Job that counts, which is the last one."""
        return self.jobs[-1] if self.jobs else None

    @property
    def ended_well(self) -> bool:
        """Return whether the last Job is complete."""
        last = self.last
        return last is not None and last.finished == "Complete" and not last.deleting

    @property
    def old(self) -> tuple[JobState, ...]:
        """Return the Jobs that another Job has replaced."""
        return self.jobs[:-1]

    @property
    def _number(self) -> int:
        return 0 if self.last is None else (number_of(self.last.name, self.task) or 0) + 1

    @property
    def next_name(self) -> str:
        """Return the name of the next Job."""
        return f"{self.task}-{self._number}" if self.jobs else self.task

    def wait(self, moment: datetime) -> float:
        """Return the delay of the next Job, if the last Job has left no message [s]."""
        if self.last is None:
            return 0.0
        pause = min(LONGEST_PAUSE, FIRST_PAUSE * (1 << min(self._number - 1, 20)))
        waited = max(timedelta(), moment - parse_time(self.last.ended))
        return max(0.0, (pause - waited).total_seconds())

    @property
    def problem(self) -> str:
        """Return the message about repeatedly lost messages; empty for the first few Jobs."""
        if self.last is None or self._number < LOST_JOBS:
            return ""
        return (
            f"{self._number} internal Jobs have finished, the last one is {self.last.name}, but "
            "the pods were deleted before the operator could read the results. Keep terminated "
            "pods of campaigns for at least one minute: check pod cleaners and "
            "--terminated-pod-gc-threshold. The operator creates the Job again after at most ten "
            "minutes."
        )


TASK_PODS_LOST = "TaskPodsLost"
"""Reason of the condition that reports the problem."""
