"""Which runs of a job are over, while it still executes others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robovast.plan import Run

FINISHED_RUNS = "finished_runs"
"""File in a job's folder where the contract's scripts list the runs that are over."""


def is_over(runs: Sequence[Run], index: int, out: Path, job: Path) -> bool:
    """The job says so, or, with an executor that does not, a later run has begun.

    Args:
        runs: those of the job, in order.
        index: which of them.
        out: the output folder of the job's runs.
        job: the job's own folder.
    """
    if runs[index].path in _finished_runs(job):
        return True
    return any((out / run.path).is_dir() for run in runs[index + 1 :])


def _finished_runs(job: Path) -> list[str]:
    try:
        return (job / FINISHED_RUNS).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
