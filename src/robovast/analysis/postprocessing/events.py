"""The options of postprocessing, and the events that its observer receives."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.base.errors import ExitCode


@dataclass(frozen=True)
class Options:
    """How results are postprocessed."""

    override: Path | None = None
    """A .vast file in place of the one that each campaign holds."""
    force: bool = False
    """Do everything again."""
    skip: tuple[str, ...] = ()
    """Commands to leave out, by name."""
    skip_rosout: bool = False
    """Leave out the conversion of ROS logs, which the document need not ask for."""
    skip_tables: bool = False
    """Write no tables: neither `data.db`, `tables.duckdb` nor `campaign.db`."""
    skip_metadata: bool = False
    """Write neither metadata.yaml nor metadata.prov.json."""
    jobs: int | None = None
    """Runs side by side; as many as there are CPUs when None."""
    time_limit: float = 3600.0
    """For one call of a command [s]."""
    debug: bool = False
    """Show what plugins print; otherwise it goes to `_execution/postprocessing.log`."""


@dataclass(frozen=True)
class Failure:
    """A command that did not succeed."""

    campaign: str
    command: str
    where: str
    """The run, as `<variant>/<number>`; empty when it was the campaign as a whole."""
    message: str
    code: ExitCode = ExitCode.TEST_FAILED

    def __str__(self) -> str:
        where = f"{self.campaign}/{self.where}" if self.where else self.campaign
        return f"{where}: {self.command}: {self.message}"


@dataclass
class CampaignSummary:
    """How postprocessing of one campaign ended."""

    campaign: Path
    runs: int = 0
    worked: set[str] = field(default_factory=set)
    """Runs that something was done for."""
    commands: int = 0
    """Commands that the document has, without those that are skipped."""
    failures: list[Failure] = field(default_factory=list)
    interrupted: bool = False


class Observer(Protocol):
    """Is told what happens."""

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """A campaign with so many runs is looked at."""

    def step_started(self, title: str, total: int) -> None:
        """A step begins, on so many runs; 1 when it is one call for all."""

    def step_advanced(self) -> None:
        """One of them has ended."""

    def failed(self, failure: Failure) -> None:
        """A command did not succeed."""

    def message(self, text: str) -> None:
        """Something worth knowing."""

    def campaign_finished(self, summary: CampaignSummary) -> None:
        """A campaign is done with."""
