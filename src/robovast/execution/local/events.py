"""The options of a local campaign, and the events that its observer receives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from robovast.campaign.run_record import RunRecord
from robovast.execution.local.pack_queue import Decided
from robovast.model.expansion import Selection
from robovast.model.plan import Run


class ExecutionObserver(Protocol):
    """Receives events one at a time, in the thread that started the campaign."""

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """The campaign's folder exists; `done` of `total` runs are already finished.

        `how` names the runtime and the number of parallel jobs.
        """

    def runs_added(self, count: int) -> None:
        """More runs belong to the campaign."""

    def run_started(self, run: Run) -> None:
        """A run began."""

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """A run ended and its results are stored."""

    def configuration_decided(self, decided: Decided) -> None:
        """The runs of a configuration are enough."""

    def message(self, text: str) -> None:
        """A message for the user."""


@dataclass(frozen=True)
class LocalOptions:
    """Options for executing a campaign on this machine."""

    select: Selection = None
    """Names or globs of the configurations to run; None means all."""
    runs: int | None = None
    """Runs of each configuration; None means the document's number."""
    batches: int | None = None
    """Batches of a search in all, in place of its budget and of what stops it; None means those."""
    jobs: int | None = None
    """Number of parallel jobs; None derives it from CPUs and a run's CPU request."""
    runtime: str = "auto"
    """docker, podman, process or auto."""
    image: str | None = None
    """Container image; None means ROBOVAST_IMAGE or the document's."""
    process_environment: Path | None = None
    """Environment of plain processes; None means the usual one."""
    gui: bool | None = None
    """Show windows on this machine's display, if there is one; None means unless the campaign was
    imported."""
    network_host: bool = False
    """Use the machine's network."""
    reuse: bool = False
    """Take over equal runs of other campaigns in the same folder instead of executing them."""
    abort_on_failure: bool = False
    """Start no further runs after the first one that does not pass."""
    enforce_resources: bool = False
    """Limit CPU and memory to the document's values (containers only)."""
    log_tree: bool = False
    """Print the live behaviour tree of scenario-execution to the logs."""
    debug: bool = False
    """Print debug logs of scenario-execution."""


@dataclass(frozen=True)
class ExecutionSummary:
    """Result of a campaign."""

    campaign: Path
    total: int
    records: list[RunRecord] = field(default_factory=list)
    """Finished runs sorted by id, including those of earlier sessions."""
    interrupted: bool = False
    decided: Sequence[Decided] = ()
    """Of a campaign with a test: what it says of each configuration."""

    @property
    def missing(self) -> int:
        """Runs that are needed and were not finished."""
        return self.total - len(self.records) - sum(one.spared for one in self.decided)
