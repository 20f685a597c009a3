"""Distributes a campaign's packs over shards, each of which is one Job. Pure functions.

Shards depend on the plan alone, so they are the same after a restart of the operator.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

from robovast.base.ranges import Span, format_ranges
from robovast.kubeapi.status import BadRuns
from robovast.model.packs import PlanSpec
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.planning.campaign import Revision

SHARD_PACKS = 500
"""Most packs of a shard, unless that gives more than SHARDS shards."""

SHARDS = 400
"""Most shards of a block of runs: the status lists them all."""

WINDOW = 4
"""How many shards a campaign keeps open at a time, if it needs several."""


@dataclass(frozen=True)
class ShardPlan:
    """A Job to create."""

    index: int
    job: str
    """Name of the Job."""
    plan: str
    """Name of the ConfigMap with its plan."""
    first_pack: int
    size: int
    """Number of completion indexes."""
    runs_per_pack: int = 1
    """Most runs of an index that one start executes."""
    attempt: int = 1
    repeat: str = ""
    """Name of the list of bad runs whose groups it repeats; empty for a first attempt."""
    configuration: str = ""
    """The Configuration object that it belongs to, if any."""
    owner: Object | None = None
    """Reference to that object."""
    after: int = 0
    """How many shards end before it begins: their runs may decide that its own are not needed."""
    parallelism: int = 1

    @property
    def packs(self) -> str:
        """Return the packs, or groups of unsuccessful runs, as a range."""
        return format_ranges([(self.first_pack, self.first_pack + self.size - 1)])


def first_attempts(identity: Identity, revisions: Sequence[Revision]) -> list[ShardPlan]:
    """Return the shards of all runs, in order; a later revision only appends."""
    if not revisions:
        return []
    shards: list[ShardPlan] = []
    newest = revisions[-1].plan
    for revision, part in _parts(revisions):
        owner = revision.owners.get(part.block)
        further = newest.by_variant and newest.blocks[part.block].first_run > 0
        after = len(shards) if further else 0
        for first, size in _stretches(newest, part.runs):
            shard = ShardPlan(
                index=len(shards),
                job=identity.child(len(shards)),
                plan=revision.config_map,
                first_pack=first,
                size=size,
                runs_per_pack=part.runs_per_pack,
                configuration=owner["name"] if owner else "",
                owner=owner,
                after=after,
            )
            shards.append(shard)
    return shards


@dataclass(frozen=True)
class _Part:
    """Runs that are planned together, and whose shards are their own."""

    runs: Span
    """Their ids."""
    block: int
    """Number of their first block; all of them have one owner."""
    runs_per_pack: int


def _parts(revisions: Sequence[Revision]) -> Iterator[tuple[Revision, _Part]]:
    """Generate what each revision appends: blocks, or rounds of what is in blocks."""
    before = 0
    for revision in revisions:
        plan = revision.plan
        bounds = list(accumulate((block.size for block in plan.blocks), initial=0))
        number = len(plan.blocks if plan.rounds is None else plan.rounds)
        for part in range(before, number):
            if plan.rounds is None:
                runs, size = (bounds[part], bounds[part + 1] - 1), plan.runs_per_job
                yield revision, _Part(runs, part, size)
            else:
                runs, size = plan.of_round(part), plan.rounds[part].size
                yield revision, _Part(runs, bisect_right(bounds, runs[0]) - 1, size)
        before = number


def _stretches(plan: PlanSpec, runs: Span) -> Iterator[Span]:
    """Generate first pack and number of packs of each shard of some runs."""
    first = plan.pack_of(runs[0])
    packs = plan.pack_of(runs[1]) - first + 1
    yield from ((first + begin, size) for begin, size in evenly(packs))


def evenly(packs: int) -> list[Span]:
    """Divide packs into shards of nearly equal size: start and size of each.

    The number of shards is a multiple of the window, so that none is left over at the end.
    """
    if packs <= SHARD_PACKS:
        return [(0, packs)]
    wanted = min(-(-packs // SHARD_PACKS), SHARDS)
    count = min(-(-wanted // WINDOW) * WINDOW, packs)  # no Job is without a pack
    bounds = [packs * number // count for number in range(count + 1)]
    return [(a, b - a) for a, b in pairwise(bounds)]


def repetitions(
    identity: Identity,
    bad: BadRuns,
    attempt: int,
    runs_per_pack: int = 1,
) -> list[ShardPlan]:
    """Return the shards that repeat unsuccessful runs; an empty list without such runs.

    Args:
        identity: of the campaign.
        bad: the runs.
        attempt: which repetition it is.
        runs_per_pack: most runs of an index that one start executes.
    """
    groups = GroupSizes.parse(bad.sizes).groups
    return [
        ShardPlan(
            index=number,
            job=identity.child(f"r{attempt}-{number}"),
            plan=bad.plan,
            first_pack=first,
            size=size,
            runs_per_pack=runs_per_pack,
            attempt=attempt,
            repeat=bad.list,
        )
        for number, (first, size) in enumerate(evenly(groups) if groups else ())
    ]


def next_shards(
    waiting: Sequence[ShardPlan],
    open_parallelism: Iterable[int],
    parallelism: int,
    *,
    alone: bool = False,
) -> list[ShardPlan]:
    """Return the shards to open now, so that never more than `parallelism` pods run.

    Args:
        waiting: shards that have no Job yet, in order.
        open_parallelism: pods that each open Job may have.
        parallelism: most pods of the campaign.
        alone: whether a shard may have all pods that are free.
    """
    opened = list(open_parallelism)
    budget = parallelism - sum(opened)
    alone = alone or (len(waiting) == 1 and not opened)
    share = parallelism if alone else -(-parallelism // WINDOW)
    made = []
    for shard in waiting:
        if budget <= 0:
            break
        pods = max(1, min(shard.size, share, budget))
        made.append(replace(shard, parallelism=pods))
        budget -= pods
    return made
