"""The progress of a job: which runs are finished, and their output."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.base import safe_paths
from robovast.campaign.layout import SYSTEM_LOG
from robovast.model.plan import Run

FINISHED_RUNS = "finished_runs"
"""File in a job's folder where the contract's scripts list finished runs."""
_LOG_END = 256 << 10
"""Part of a log that is searched for the reason why a run did not pass [bytes]."""


@dataclass(frozen=True)
class PackOutput:
    """A job's output, which it may change at any time; links in it are never followed."""

    out: Path
    """The output folder of the job's runs; the job cannot replace the folder itself."""
    own: Path
    """The job's own folder."""
    root: Path
    """Ancestor of it, or the folder itself, that the job cannot replace."""
    console: Path | None = None
    """Log to use if the job has none; in a folder that the job cannot replace."""

    def is_over(self, runs: Sequence[Run], index: int) -> bool:
        """Whether a run is finished: the job reports it, or a later run has begun.

        Args:
            runs: the job's runs, in order.
            index: index of the run.
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
        """Whether the run's folder exists."""
        return safe_paths.is_folder(self.out / run.path, self.out)

    def log_end(self) -> bytes:
        """The end of the job's log; empty if there is none."""
        log = _end_of(self.own / SYSTEM_LOG, self.root)
        return log or (_end_of(self.console, self.console.parent) if self.console else b"")

    def take(self, run: Run, stored: Path) -> Path:
        """Move a run's output out of the job's reach, whatever modes its folders have.

        Args:
            run: the run; nothing is moved when it has no folder.
            stored: target folder for runs; created if missing.
        """
        target = stored / run.path
        stored.mkdir(parents=True, exist_ok=True)
        source = self.out / run.path
        for folder in (self.out, source.parent, source):
            safe_paths.regain(folder, self.out.parent)
        if self.has_begun(run):
            safe_paths.move(source, self.out, target, stored)
        return target


def _end_of(log: Path, root: Path) -> bytes:
    """The end of a log below a folder; empty if there is none."""
    try:
        return safe_paths.read_end(log, root, _LOG_END)
    except OSError:
        return b""


def keep_the_rest(out: Path, own: Path, but: Collection[str] = ()) -> None:
    """Move a finished job's output outside its runs' folders to `out` in its own folder.

    Args:
        out: the job's output folder, without its finished runs.
        own: the job's own folder, which the job cannot replace.
        but: names at the top of `out` to leave there.
    """
    for folder in (out, own):
        safe_paths.regain(folder, folder.parent)
    safe_paths.remove_empty_folders(out, out)
    place = safe_paths.unused(own / "out", own)
    for name in safe_paths.names(out, out):
        if name not in but:
            safe_paths.move(out / name, out, place / name, own)
