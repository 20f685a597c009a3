"""All runs of one campaign, kept up to date during execution.

Reading 10,000 records takes most of a second, so a variant is read again only if its folder has
changed: complete runs enter it by a rename.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.sequential import SequentialTest
from robovast.campaign.decisions import recorded_test
from robovast.campaign.layout import EXECUTION_RECORD
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaigns import active_jobs, is_own_folder
from robovast.evaluation.inside import resolved
from robovast.evaluation.stored_runs import read_variant, seconds
from robovast.evaluation.summaries import (
    ActiveJob,
    CampaignSummary,
    RunSummary,
    VariantRuns,
    decision_of,
)
from robovast.evaluation.untrusted import read_yaml

SETTLED = 2.0
"""Folders changed more recently may change again within the same time stamp [s]."""


@dataclass(frozen=True)
class _Known:
    changed: int
    """Time stamp of the folder [ns]."""
    settled: bool
    variant: VariantRuns


class CampaignIndex:
    """The runs of a campaign's folder; one thread may refresh it while others read."""

    def __init__(self, results: Path, name: str) -> None:
        self.results = results
        """The results folder, without links."""
        self.name = name
        """The campaign's folder in it."""
        self.version = 0
        """Increases with every change."""
        self.variants: list[VariantRuns] = []
        """All variants, including those without runs; `two-2-10` comes after `two-2-9`."""
        self.active: tuple[ActiveJob, ...] | None = None
        """Jobs in progress; None if the campaign is not being executed."""
        self._execution: Mapping[str, Any] = {}
        self._known: dict[str, _Known] = {}

    def refresh(self) -> bool:
        """Read changed variants; return whether anything changed.

        Raises:
            InputError: the folder is missing or cannot be read.
        """
        root = resolved(self.results, self.name)
        try:
            folders = [entry for entry in os.scandir(root) if is_own_folder(entry)]
        except OSError as error:
            raise InputError(f"{self.name} cannot be read: {error.strerror}.") from None
        known = {entry.name: found for entry in folders if (found := self._look(entry))}
        execution = read_yaml(self.results, f"{self.name}/{EXECUTION_RECORD}")
        active = active_jobs(self.results, self.name)
        variants = [item.variant for _, item in sorted(known.items(), key=_by_name)]
        before = (self.variants, self._execution, self.active)
        changed = not self.version or (variants, execution, active) != before
        self._known, self.variants = known, variants
        self._execution, self.active = execution, active
        self.version += changed
        return changed

    def summary(self) -> CampaignSummary:
        """Counts and times as of the last refresh."""
        runs = [run for variant in self.variants for run in variant.runs]
        test = recorded_test(self._execution)
        planned = max(self._planned(test), len(runs))
        counts = dict.fromkeys(Verdict, 0)
        for run in runs:
            counts[run.verdict] += 1
        missing = planned - len(runs) + counts[Verdict.INTERRUPTED]
        running = self.active is not None
        started, ended = _period(runs, seconds(self._execution.get("execution_time")))
        ended = time.time() if running else ended
        return CampaignSummary(
            name=self.name,
            state="running" if running else "incomplete" if missing else "finished",
            planned=planned,
            counts=counts,
            reused=sum(run.reused for run in runs),
            variants=len(self.variants),
            started_at=started,
            duration=None if started is None or ended is None else max(0.0, ended - started),
            execution=self._execution,
            version=self.version,
            test=test,
        )

    def _planned(self, test: SequentialTest | None) -> int:
        """Runs that are planned; with a test, without those that are not needed."""
        each = _whole(self._execution.get("runs"))
        if test is None:
            return len(self.variants) * each
        return sum(
            len(variant.runs) if decision_of(test, variant).is_over else each
            for variant in self.variants
        )

    def _look(self, entry: os.DirEntry[str]) -> _Known | None:
        """A variant, read again if its folder has changed; None if it cannot be read."""
        try:
            changed = entry.stat(follow_symlinks=False).st_mtime_ns
            known = self._known.get(entry.name)
            if known is not None and known.settled and known.changed == changed:
                return known
            settled = time.time() - changed / 1e9 > SETTLED
            return _Known(changed, settled, read_variant(self.results, self.name, entry.name))
        except OSError:  # it was removed, or access is denied
            return None


def _period(runs: Iterable[RunSummary], started: float | None) -> tuple[float | None, float | None]:
    """Start of the campaign or its first run, and end of its last run."""
    times = [(r.started_at, r.started_at + (r.duration or 0)) for r in runs if r.started_at]
    first = min((begin for begin, _ in times), default=None)
    return (first if started is None else started), max((end for _, end in times), default=None)


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and 0 < value < 1_000_000 else 0


def _by_name(item: tuple[str, Any]) -> list[tuple[bool, int, str]]:
    parts = item[0].split("-")
    return [(not p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts]
