"""The progress of a job: which runs are finished, and their output."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from robovast.base import safe_paths
from robovast.campaign.layout import SYSTEM_LOG, TEST_RESULT
from robovast.model.plan import Run

FINISHED_RUNS = "finished_runs"
"""File in a job's folder where the contract's scripts list finished runs."""
_LOG_END = 2 << 20
"""Most of a log that is searched for the reason why a run did not pass [bytes]; also more than the
next run writes until this one is noticed to be finished."""


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

    def is_over(self, run: Run) -> bool:
        """Whether the contract's driver says that a run is finished, which no folder can say."""
        try:
            listed = safe_paths.read_file(self.own / FINISHED_RUNS, self.root)
        except OSError:
            return False
        return run.path.encode() in listed.splitlines()

    def has_result(self, run: Run) -> bool:
        """Whether the run has a test.xml."""
        return safe_paths.is_file(self.out / run.path / TEST_RESULT, self.out)

    def has_begun(self, run: Run) -> bool:
        """Whether the run's folder exists."""
        return safe_paths.is_folder(self.out / run.path, self.out)

    def log_end(self, begin: int) -> tuple[bytes, int]:
        """The end of the job's log, not before `begin`, and where it ends; empty without a log."""
        found = _end_of(self.own / SYSTEM_LOG, self.root, begin)
        if not found[1] and self.console:
            return _end_of(self.console, self.console.parent, begin)
        return found

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


def _end_of(log: Path, root: Path, begin: int) -> tuple[bytes, int]:
    try:
        return safe_paths.read_end(log, root, _LOG_END, begin)
    except OSError:
        return b"", 0


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
