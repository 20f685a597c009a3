"""The options of a local campaign, and the events that its observer receives."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.campaign.run_record import RunRecord
from robovast.model.plan import Run


class Observer(Protocol):
    """Receives events, one at a time, from the thread that called the campaign."""

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """The campaign's folder exists; `done` of `total` runs were finished before.

        `how` names the runtime and the number of jobs side by side.
        """

    def run_started(self, run: Run) -> None:
        """A run began."""

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """A run ended and its results are stored."""

    def message(self, text: str) -> None:
        """Something that a person wants to know."""


@dataclass(frozen=True)
class LocalOptions:
    """How a campaign is executed on this machine."""

    select: str | None = None
    """Name or glob of the configurations to run; all when None."""
    runs: int | None = None
    """Runs of each configuration; the document's when None."""
    jobs: int | None = None
    """Jobs side by side; from the CPUs that a run asks for when None."""
    runtime: str = "auto"
    """docker, podman, process or auto."""
    image: str | None = None
    """Container image; ROBOVAST_IMAGE, then the document's, when None."""
    gui: bool = True
    """Show windows on this machine's display when there is one."""
    network_host: bool = False
    """Use the network of the machine."""
    abort_on_failure: bool = False
    """Start nothing more after the first run that does not pass."""
    enforce_resources: bool = False
    """Limit CPU and memory to what the document asks for (containers)."""
    log_tree: bool = False
    """Live behaviour tree of scenario-execution in the logs."""
    debug: bool = False
    """Debug log of scenario-execution."""


@dataclass(frozen=True)
class Summary:
    """How a campaign ended."""

    campaign: Path
    total: int
    records: list[RunRecord] = field(default_factory=list)
    """Runs that ended, in the order of their ids, earlier sessions included."""
    interrupted: bool = False
