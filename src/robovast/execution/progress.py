"""The progress of a job: which of its runs are over, and what they and the job itself wrote."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.base import safe_paths
from robovast.campaign.layout import SYSTEM_LOG
from robovast.model.plan import Run

FINISHED_RUNS = "finished_runs"
"""File in a job's folder where the contract's scripts list the runs that are over."""
_LOG_END = 4096
"""Of a log, what is looked through for its last line [bytes]."""


@dataclass(frozen=True)
class JobOutput:
    """Where a job writes, and may make at any time whatever it likes; no link there is followed."""

    out: Path
    """The output folder of the job's runs; itself out of the job's reach."""
    own: Path
    """The job's own folder."""
    root: Path
    """Folder on the way to it, or it itself, that is out of the job's reach."""

    def is_over(self, runs: Sequence[Run], index: int) -> bool:
        """The job says so, or, with an executor that does not, a later run has begun.

        Args:
            runs: those of the job, in order.
            index: which of them.
        """
        if runs[index].path in self._finished_runs():
            return True
        return any(self.has_begun(run) for run in runs[index + 1 :])

    def _finished_runs(self) -> list[str]:
        try:
            return safe_paths.read_text(self.own / FINISHED_RUNS, self.root).splitlines()
        except OSError:
            return []

    def has_begun(self, run: Run) -> bool:
        """True when there is a folder of the run."""
        return safe_paths.is_folder(self.out / run.path, self.out)

    def log_end(self) -> bytes:
        """The end of the job's log; empty without one."""
        return end_of(self.own / SYSTEM_LOG, self.root)

    def take(self, run: Run, stored: Path) -> Path:
        """Move what a run wrote to where no job reaches it, whatever modes it gave its folders.

        Args:
            run: the run; nothing is moved when it has no folder.
            stored: folder of what was taken; made when it is not there.
        """
        target = stored / run.path
        stored.mkdir(parents=True, exist_ok=True)
        source = self.out / run.path
        for folder in (self.out, source.parent, source):
            safe_paths.regain(folder, self.out.parent)
        if self.has_begun(run):
            safe_paths.move(source, self.out, target, stored)
        return target


def end_of(log: Path, root: Path) -> bytes:
    """The end of a log below a folder; empty without one."""
    try:
        return safe_paths.read_end(log, root, _LOG_END)
    except OSError:
        return b""


def keep_the_rest(out: Path, own: Path, but: Collection[str] = ()) -> None:
    """Move what a job that is over wrote outside its runs' folders to `out` in its own folder.

    Args:
        out: the output folder of the job, without the runs that are over.
        own: the job's own folder, itself out of the job's reach.
        but: names at the top of `out` that stay.
    """
    for folder in (out, own):
        safe_paths.regain(folder, folder.parent)
    safe_paths.remove_empty_folders(out, out)
    place = safe_paths.unused(own / "out", own)
    for name in safe_paths.names(out, out):
        if name not in but:
            safe_paths.move(out / name, out, place / name, own)
