"""All runs of one campaign, kept up to date during execution.

Reading 10,000 records takes most of a second, so a variant is read again only if its folder has
changed: complete runs enter it by a rename.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.campaign.decisions import CampaignTest, recorded_test
from robovast.campaign.layout import EXECUTION_RECORD
from robovast.campaign.planned_runs import planned_runs
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaigns import active_jobs, is_own_folder, is_search
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.mirrored_jobs import mirrored_jobs
from robovast.evaluation.stored_runs import read_variant
from robovast.evaluation.summaries import (
    ActiveJob,
    CampaignSummary,
    RunSummary,
    VariantRuns,
    decision_of,
    seconds,
)
from robovast.evaluation.untrusted_data import read_yaml
from robovast.model.naming import CONFIG

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
        self.reading: tuple[int, int] | None = None
        """While it is refreshed: how many variants have been looked at, and of how many."""
        self._execution: Mapping[str, Any] = {}
        self._is_search = False
        self._known: dict[str, _Known] = {}
        self._begun: dict[str, _Known] = {}
        """What the refresh that is under way has read."""

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
        self._begun = known = {}
        for entry in self._counted(folders):
            if found := self._look(entry):
                known[entry.name] = found
        execution = read_yaml(self.results, f"{self.name}/{EXECUTION_RECORD}")
        variants = _in_order(known)
        active = active_jobs(self.results, self.name)
        if active is None:
            active = mirrored_jobs(self.results, self.name, variants, time.time())
        searches = is_search(self.results, self.name)
        before = (self.variants, self._execution, self.active, self._is_search)
        changed = not self.version or (variants, execution, active, searches) != before
        self._known, self.variants = known, variants
        self._execution, self.active, self._is_search = execution, active, searches
        self.version += changed
        return changed

    def summary(self) -> CampaignSummary:
        """Counts and times as of the last refresh."""
        return summarized(
            self.name,
            self.variants,
            self._execution,
            is_search=self._is_search,
            running=self.active is not None,
            version=self.version,
        )

    def begun(self) -> tuple[CampaignSummary, list[VariantRuns]]:
        """What has been read so far, while another thread reads the campaign."""
        variants = _in_order(self._begun)
        return summarized(self.name, variants, {}), variants

    def _counted(self, folders: Sequence[os.DirEntry[str]]) -> Iterator[os.DirEntry[str]]:
        for done, entry in enumerate(folders):
            self.reading = done, len(folders)
            yield entry
        self.reading = None

    def _look(self, entry: os.DirEntry[str]) -> _Known | None:
        """A configuration, read again if its folder has changed; None for any other folder."""
        try:
            changed = entry.stat(follow_symlinks=False).st_mtime_ns
            known = self._known.get(entry.name)
            if known and known.settled and known.changed == changed:
                return known
            settled = time.time() - changed / 1e9 > SETTLED
            variant = read_variant(self.results, self.name, entry.name)
            own = variant.runs or os.path.isdir(f"{entry.path}/{CONFIG}")
            return _Known(changed, settled, variant) if own else None
        except OSError:  # it was removed, or access is denied
            return None


def summarized(
    name: str,
    variants: Sequence[VariantRuns],
    execution: Mapping[str, Any],
    *,
    is_search: bool = False,
    running: bool = False,
    version: int = 0,
) -> CampaignSummary:
    """Counts and times of a campaign.

    Args:
        name: of its folder.
        variants: all its variants.
        execution: content of execution.yaml.
        is_search: whether a search chose its runs.
        running: whether it is being executed.
        version: see `CampaignSummary`.
    """
    runs = [run for variant in variants for run in variant.runs]
    test = recorded_test(execution)
    planned = max(_planned(variants, execution, test), len(runs))
    found = Counter(run.verdict for run in runs)
    counts = {verdict: found[verdict] for verdict in Verdict}
    missing = planned - len(runs) + counts[Verdict.INTERRUPTED]
    started, ended = _period(runs, seconds(execution.get("execution_time")))
    ended = time.time() if running else ended
    return CampaignSummary(
        name=name,
        state="running" if running else "incomplete" if missing else "finished",
        planned=planned,
        counts=counts,
        reused=sum(run.reused for run in runs),
        variants=len(variants),
        started_at=started,
        duration=None if started is None or ended is None else max(0.0, ended - started),
        execution=execution,
        version=version,
        test=test,
        is_search=is_search,
    )


def _planned(
    variants: Sequence[VariantRuns], execution: Mapping[str, Any], test: CampaignTest | None
) -> int:
    """Runs that are planned; with a test, without those that are not needed."""
    planned = planned_runs(execution)
    return sum(
        len(variant.runs)
        if test is not None and decision_of(test, variant).is_over
        else planned.of(variant.name)
        for variant in variants
    )


def _period(runs: Iterable[RunSummary], started: float | None) -> tuple[float | None, float | None]:
    """Start of the campaign or its first run, and end of its last run."""
    times = [(begin, run.duration or 0) for run in runs if (begin := run.started_at)]
    first = started if started is not None else min((begin for begin, _ in times), default=None)
    return first, max((begin + lasted for begin, lasted in times), default=None)


def _in_order(known: Mapping[str, _Known]) -> list[VariantRuns]:
    """Variants by their numbers; another thread may add some meanwhile."""
    return [item.variant for _, item in sorted(known.items(), key=lambda item: by_number(item[0]))]


def by_number(name: str) -> list[tuple[bool, int, str]]:
    """Key that sorts names of variants by their numbers."""
    parts = name.split("-")
    return [(not p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts]
