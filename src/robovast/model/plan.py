"""The runs of a campaign, and the jobs that execute them, by its plan.

The plan is a pure function of the variants in order, the number of runs and the size of a pack.
"""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from robovast.base.errors import InputError
from robovast.model.packs import RUNS_LIMIT, Block, PlanSpec, format_breaks
from robovast.model.seeds import run_seed
from robovast.model.variant import Variant


@dataclass(frozen=True, slots=True)
class Run:
    """One execution of a variant."""

    id: int
    """Number of the run in the campaign, from 0."""
    variant: Variant
    number: int
    """Number of the run within its variant, from 0; also the name of its results folder."""
    seed: int | None = None
    """Seed of its random numbers; None in campaigns of RoboVAST 1.x."""

    @property
    def path(self) -> str:
        """Results folder relative to the campaign, `<variant>/<number>`."""
        return f"{self.variant.name}/{self.number}"


@dataclass(frozen=True, slots=True)
class PackStart:
    """Runs of a pack that one start of its containers executes, one after the other."""

    index: int
    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """Folder name below `_jobs`."""
        return f"job-{self.index}"


def plan_variants(
    variants: Sequence[Variant],
    runs: int,
    runs_per_job: int = 1,
    more: Mapping[str, int] = MappingProxyType({}),
) -> PlanSpec:
    """The plan for executing each variant `runs` times.

    Args:
        variants: of the campaign, in order.
        runs: of each variant.
        runs_per_job: most runs of a pack.
        more: runs in all of variants that have more than that, by name.

    Raises:
        InputError: a campaign cannot have so many runs.
    """
    further = [
        Block(first_variant=place, variants=1, first_run=runs, runs=wanted - runs)
        for place, variant in enumerate(variants)
        if (wanted := more.get(variant.name, 0)) > runs
    ]
    total = len(variants) * runs + sum(block.size for block in further)
    if total > RUNS_LIMIT:
        raise InputError(
            f"the campaign would have {total:,} runs, more than {RUNS_LIMIT:,}",
            hint="lower `execution.runs`, or select fewer configurations",
        )
    apart = format_breaks(breaks(variants))
    blocks = (Block(first_variant=0, variants=len(variants), runs=runs),) if total > 0 else ()
    return PlanSpec(blocks=(*blocks, *further), runs_per_job=runs_per_job, breaks=apart)


def plan_runs(plan: PlanSpec, variants: Sequence[Variant], seed: int | None = None) -> list[Run]:
    """All runs of a plan; the runs of a variant stay together.

    Args:
        plan: the plan.
        variants: of the campaign, in order.
        seed: of the campaign.
    """
    return [planned_run(plan, variants, id_, seed) for id_ in range(plan.total)]


def planned_run(
    plan: PlanSpec, variants: Sequence[Variant], id_: int, seed: int | None = None
) -> Run:
    """The run of an id.

    Raises:
        IndexError: the plan has no such run, or too few variants are given.
    """
    index, number = plan.run(id_)
    variant = variants[index]
    return Run(id_, variant, number, run_seed(seed, variant.name, number))


def block_runs(
    plan: PlanSpec, block: Block, variants: Sequence[Variant], seed: int | None
) -> list[Run]:
    """The runs of one block of a plan; no two blocks are equal, since runs are planned once."""
    first = sum(earlier.size for earlier in plan.blocks[: plan.blocks.index(block)])
    return [planned_run(plan, variants, first + i, seed) for i in range(block.size)]


def pack_runs(plan: PlanSpec, runs: Iterable[Run], first_job: int = 0) -> list[PackStart]:
    """Group runs of a plan, in order, into packs, each to be started once."""
    by_id = {run.id: run for run in runs}
    packs = enumerate(plan.packed(by_id), first_job)
    return [PackStart(index, tuple(map(by_id.__getitem__, pack))) for index, pack in packs]


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
