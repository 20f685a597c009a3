"""What a job has done: which runs are over, and what it wrote beside them."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Sequence
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


def keep_the_rest(out: Path, job: Path, but: Collection[str] = ()) -> None:
    """Move what a job wrote outside its runs' folders to `out` in its own folder.

    Args:
        out: the output folder of the job, without the runs that are over.
        job: the job's own folder.
        but: names at the top of `out` that stay.
    """
    for path in [path for path in out.rglob("*") if path.is_file() or path.is_symlink()]:
        relative = path.relative_to(out)
        if relative.parts[0] not in but:
            target = job / "out" / relative
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(path, target)
