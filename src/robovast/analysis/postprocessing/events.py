"""Options of postprocessing, and the events that an observer receives."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.base.errors import ExitCode


@dataclass(frozen=True)
class Options:
    """Options of postprocessing."""

    override: Path | None = None
    """A .vast file that replaces those in the campaigns."""
    force: bool = False
    """Repeat everything."""
    skip: tuple[str, ...] = ()
    """Names of commands to leave out."""
    skip_rosout: bool = False
    """Leave out the conversion of ROS logs, which is done even if the document does not list it."""
    skip_tables: bool = False
    """Write no tables: neither `data.db`, `tables.duckdb` nor `campaign.db`."""
    skip_metadata: bool = False
    """Write neither metadata.yaml nor metadata.prov.json."""
    jobs: int | None = None
    """Number of parallel processes; None means the number of CPUs."""
    time_limit: float = 3600.0
    """Time limit for one call of a command [s]."""
    debug: bool = False
    """Show the output of plugins; otherwise it goes to `_execution/postprocessing.log`."""


@dataclass(frozen=True)
class Failure:
    """A command that failed."""

    campaign: str
    command: str
    where: str
    """The run, as `<variant>/<number>`; empty for the whole campaign."""
    message: str
    code: ExitCode = ExitCode.TEST_FAILED

    def __str__(self) -> str:
        where = f"{self.campaign}/{self.where}" if self.where else self.campaign
        return f"{where}: {self.command}: {self.message}"


@dataclass
class PostprocessingSummary:
    """Result of postprocessing one campaign."""

    campaign: Path
    document: Path | None = None
    """The .vast file with the commands, if there is one."""
    runs: int = 0
    written: list[str] = field(default_factory=list)
    """Names of the results of the whole campaign that were written, such as tables and metadata."""
    worked: set[str] = field(default_factory=set)
    """Number of runs that were processed."""
    commands: int = 0
    """Number of the document's commands, without skipped ones."""
    failures: list[Failure] = field(default_factory=list)
    interrupted: bool = False


class PostprocessingObserver(Protocol):
    """Receives progress events."""

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Postprocessing of a campaign with this number of runs starts."""

    def step_started(self, title: str, total: int) -> None:
        """A step starts, with its number of calls."""

    def step_advanced(self) -> None:
        """A call of the step has ended."""

    def failed(self, failure: Failure) -> None:
        """A command failed."""

    def message(self, text: str) -> None:
        """A message for the user."""

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        """Postprocessing of a campaign has ended."""
