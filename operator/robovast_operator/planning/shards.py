"""Distributes a campaign's packs over shards, each of which is one Job. Pure functions.

Shards depend on the plan alone, so they are the same after a restart of the operator.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

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
    attempt: int = 1
    repeat: str = ""
    """Name of the list of bad runs whose groups it repeats; empty for a first attempt."""
    configuration: str = ""
    """The Configuration object that it belongs to, if any."""
    owner: Object | None = None
    """Reference to that object."""
    parallelism: int = 1

    @property
    def packs(self) -> str:
        """The packs, or groups of bad runs, as a range."""
        return format_ranges([(self.first_pack, self.first_pack + self.size - 1)])


def first_attempts(identity: Identity, revisions: Sequence[Revision]) -> list[ShardPlan]:
    """The shards of all runs, in order; a later revision only appends."""
    if not revisions:
        return []
    shards: list[ShardPlan] = []
    newest = revisions[-1].plan
    known = 0
    for revision in revisions:
        for block in range(known, len(revision.plan.blocks)):
            owner = revision.owners.get(block)
            for first, size in _stretches(newest, block):
                shard = ShardPlan(
                    index=len(shards),
                    job=identity.child(len(shards)),
                    plan=revision.config_map,
                    first_pack=first,
                    size=size,
                    configuration=owner["name"] if owner else "",
                    owner=owner,
                )
                shards.append(shard)
        known = len(revision.plan.blocks)
    return shards


def _stretches(plan: PlanSpec, block: int) -> Iterator[Span]:
    """First pack and number of packs of each shard of a block."""
    first_id = sum(b.size for b in plan.blocks[:block])
    first = plan.pack_of(first_id)
    packs = plan.pack_of(first_id + plan.blocks[block].size - 1) - first + 1
    yield from ((first + begin, size) for begin, size in evenly(packs))


def evenly(packs: int) -> list[Span]:
    """Divide packs into shards of nearly equal size: start and size of each.

    The number of shards is a multiple of the window, so that none is left over at the end.
    """
    if packs <= SHARD_PACKS:
        return [(0, packs)]
    wanted = min(-(-packs // SHARD_PACKS), SHARDS)
    count = -(-wanted // WINDOW) * WINDOW
    bounds = [packs * number // count for number in range(count + 1)]
    return [(a, b - a) for a, b in pairwise(bounds)]


def repetitions(identity: Identity, bad: BadRuns, attempt: int) -> list[ShardPlan]:
    """The shards that repeat bad runs; none if no run is bad."""
    groups = GroupSizes.parse(bad.sizes).groups
    return [
        ShardPlan(
            index=number,
            job=identity.child(f"r{attempt}-{number}"),
            plan=bad.plan,
            first_pack=first,
            size=size,
            attempt=attempt,
            repeat=bad.list,
        )
        for number, (first, size) in enumerate(evenly(groups) if groups else ())
    ]


def next_shards(
    waiting: Sequence[ShardPlan], open_parallelism: Iterable[int], parallelism: int
) -> list[ShardPlan]:
    """The shards to open now, so that never more than `parallelism` pods run.

    Args:
        waiting: shards that have no Job yet, in order.
        open_parallelism: pods that each open Job may have.
        parallelism: most pods of the campaign.
    """
    opened = list(open_parallelism)
    budget = parallelism - sum(opened)
    alone = len(waiting) == 1 and not opened
    share = parallelism if alone else -(-parallelism // WINDOW)
    made = []
    for shard in waiting:
        if budget <= 0:
            break
        pods = max(1, min(shard.size, share, budget))
        made.append(replace(shard, parallelism=pods))
        budget -= pods
    return made
