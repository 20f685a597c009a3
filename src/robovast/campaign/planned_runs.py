"""How many runs of each configuration are planned, in `_execution/execution.yaml`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from robovast.model.packs import RUNS_LIMIT

RUNS = "runs"
"""Key of the runs of every configuration."""
MORE_RUNS = "more_runs"
"""Key of the runs, in all, of configurations that were given more, by name."""

ADDED = "runs_added"
"""Key that is true once configurations were given more runs than the campaign began with."""


@dataclass(frozen=True)
class PlannedRuns:
    """How many runs each configuration of a campaign has."""

    each: int
    """Of every configuration."""
    more: Mapping[str, int] = field(default_factory=dict)
    """In all, of those that have more, by name."""
    added: bool = False
    """Whether configurations have more than the campaign began with."""

    def of(self, variant: str) -> int:
        """Runs of a configuration."""
        return max(self.each, self.more.get(variant, 0))

    def raised(self, runs: int, chosen: Collection[str] | None) -> PlannedRuns:
        """So many runs of the chosen configurations, None means all; no fewer than before."""
        if chosen is None:
            each = max(self.each, runs)
            more = {name: n for name, n in self.more.items() if n > each}
            return PlannedRuns(each, more, self.added or each > self.each)
        further = {name: runs for name in chosen if runs > self.of(name)}
        return replace(self, more={**self.more, **further}, added=self.added or bool(further))

    def record(self) -> dict[str, Any]:
        """The entries of `_execution/execution.yaml`."""
        more = {MORE_RUNS: dict(self.more)} if self.more else {}
        return {RUNS: self.each, **more, **({ADDED: True} if self.added else {})}


def planned_runs(execution: Mapping[str, Any]) -> PlannedRuns:
    """What the content of `_execution/execution.yaml` plans; 0 where it says nothing valid."""
    more = execution.get(MORE_RUNS)
    listed = more.items() if isinstance(more, Mapping) else ()
    return PlannedRuns(
        _whole(execution.get(RUNS)),
        {str(name): _whole(n) for name, n in listed if _whole(n)},
        execution.get(ADDED) is True,
    )


def is_fixed(execution: Mapping[str, Any]) -> bool:
    """Whether no runs were added; whoever adds runs has usually seen the verdicts of others."""
    return not planned_runs(execution).added


def _whole(value: Any) -> int:
    return value if type(value) is int and 0 < value <= RUNS_LIMIT else 0
