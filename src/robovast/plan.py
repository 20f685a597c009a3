"""The plan of a campaign: which run is which, and which runs share a job.

A plan is a pure function of the variants in order, the number of runs and the size of a pack.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from robovast.expansion.variant import Variant


@dataclass(frozen=True, slots=True)
class Run:
    """One variant executed once."""

    id: int
    """Number of the run in the campaign, from 0."""
    variant: Variant
    number: int
    """Number of the run of its variant, from 0: the name of its results folder."""

    @property
    def path(self) -> str:
        """Results folder relative to the campaign, `<variant>/<number>`."""
        return f"{self.variant.name}/{self.number}"


@dataclass(frozen=True, slots=True)
class Job:
    """Runs that are executed one after another in one container."""

    index: int
    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """Folder name below `_jobs`."""
        return f"job-{self.index}"


def plan_runs(variants: Sequence[Variant], runs: int) -> list[Run]:
    """Every run of a campaign; the runs of a variant stay together."""
    pairs = ((variant, number) for variant in variants for number in range(runs))
    return [Run(id_, variant, number) for id_, (variant, number) in enumerate(pairs)]


def pack_runs(runs: Iterable[Run], runs_per_job: int, first_job: int = 0) -> list[Job]:
    """Runs in jobs of at most `runs_per_job`, in order.

    Variants that bring different files of one name cannot share a config folder, so a job also
    ends where that would happen.
    """
    packs = _packs(runs, runs_per_job)
    return [Job(first_job + index, tuple(pack)) for index, pack in enumerate(packs)]


def _packs(runs: Iterable[Run], size: int) -> Iterator[list[Run]]:
    pack: list[Run] = []
    sources: dict[str, object] = {}
    for run in runs:
        clash = any(
            sources.get(file.name, file.source) != file.source for file in run.variant.files
        )
        if pack and (len(pack) == size or clash):
            yield pack
            pack, sources = [], {}
        pack.append(run)
        sources.update((file.name, file.source) for file in run.variant.files)
    if pack:
        yield pack
