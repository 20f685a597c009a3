"""The plan of a campaign: the ids of its runs, and how they are packed.

A plan is a pure function of the variants in order, the number of runs and the size of a pack.
"""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.model.expansion.variant import Variant


@dataclass(frozen=True, slots=True)
class Run:
    """One execution of a variant."""

    id: int
    """Number of the run in the campaign, from 0."""
    variant: Variant
    number: int
    """Number of the run within its variant, from 0; also the name of its results folder."""

    @property
    def path(self) -> str:
        """Results folder relative to the campaign, `<variant>/<number>`."""
        return f"{self.variant.name}/{self.number}"


@dataclass(frozen=True, slots=True)
class Job:
    """A pack: runs that are executed one after the other by one start of the containers."""

    index: int
    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """Folder name below `_jobs`."""
        return f"job-{self.index}"


def plan_runs(variants: Sequence[Variant], runs: int) -> list[Run]:
    """All runs of a campaign; the runs of a variant stay together."""
    pairs = ((variant, number) for variant in variants for number in range(runs))
    return [Run(id_, variant, number) for id_, (variant, number) in enumerate(pairs)]


def pack_runs(runs: Iterable[Run], runs_per_job: int, first_job: int = 0) -> list[Job]:
    """Group runs, in order, into packs of at most `runs_per_job`.

    A pack also ends at each of `breaks`, since its variants share one config folder.
    """
    packs = _packs(list(runs), runs_per_job)
    return [Job(first_job + index, tuple(pack)) for index, pack in enumerate(packs)]


def _packs(runs: list[Run], size: int) -> Iterator[list[Run]]:
    variants = list({run.variant.name: run.variant for run in runs}.values())
    starts = {variants[index].name for index in breaks(variants)}
    pack: list[Run] = []
    for run in runs:
        other = bool(pack) and pack[-1].variant.name != run.variant.name
        if pack and (len(pack) == size or (other and run.variant.name in starts)):
            yield pack
            pack = []
        pack.append(run)
    if pack:
        yield pack


def breaks(variants: Sequence[Variant]) -> list[int]:
    """Indexes of the variants that cannot share a pack with the previous variant.

    Variants with different files of one name cannot share a config folder; a break is set where a
    variant conflicts with any variant since the previous break.
    """
    found: list[int] = []
    sources: dict[str, Path] = {}
    for index, variant in enumerate(variants):
        if not all(
            _same(sources.get(file.name, file.source), file.source) for file in variant.files
        ):
            found.append(index)
            sources = {}
        sources.update((file.name, file.source) for file in variant.files)
    return found


def _same(one: Path, other: Path) -> bool:
    """Whether two files have the same content: variants often bring copies of one map."""
    try:
        return one == other or filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False
