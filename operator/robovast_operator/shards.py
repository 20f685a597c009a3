"""Shards: which Jobs a campaign's packs of runs are spread over. Pure functions.

Shards depend on the plan alone, so they are the same after a restart of the operator.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from robovast.cluster.plan import PlanSpec, retry_groups
from robovast.cluster.ranges import Span, format_ranges, parse_ranges, spans
from robovast_operator.campaign import Identity, Object, Revision

SHARD_PACKS = 500
"""Most packs of a shard, while that gives no more than SHARDS shards."""

SHARDS = 400
"""Most shards of a block of runs: the status names them all."""

WINDOW = 4
"""A campaign that needs several shards keeps this many open."""


@dataclass(frozen=True)
class ShardPlan:
    """A Job that is to be made."""

    index: int
    job: str
    """Name of the Job."""
    plan: str
    """Name of the ConfigMap with its plan."""
    first_pack: int
    size: int
    """Number of completion indexes."""
    attempt: int = 1
    runs: str = ""
    """Ids of the runs that are executed once more; empty for a first attempt."""
    configuration: str = ""
    """The Configuration object that it belongs to, if any."""
    owner: Object | None = None
    """Reference to that object."""
    parallelism: int = 1

    @property
    def packs(self) -> str:
        """The packs as a range; empty for a repetition."""
        last = self.first_pack + self.size - 1
        return "" if self.runs else format_ranges([(self.first_pack, last)])


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
    """Packs cut into shards of nearly one size: begin and size of each.

    The number of shards is a multiple of the window, so that none is left over at the end.
    """
    if packs <= SHARD_PACKS:
        return [(0, packs)]
    wanted = min(-(-packs // SHARD_PACKS), SHARDS)
    count = -(-wanted // WINDOW) * WINDOW
    bounds = [packs * number // count for number in range(count + 1)]
    return [(a, b - a) for a, b in pairwise(bounds)]


def repetitions(
    identity: Identity, revision: Revision, attempt: int, bad: Iterable[Span], first_index: int
) -> list[ShardPlan]:
    """The shards that execute bad runs once more."""
    groups = retry_groups(revision.plan, bad)
    made = []
    for number, begin in enumerate(range(0, len(groups), SHARD_PACKS)):
        part = groups[begin : begin + SHARD_PACKS]
        made.append(
            ShardPlan(
                index=first_index + number,
                job=identity.child(f"r{attempt}-{number}"),
                plan=revision.config_map,
                first_pack=0,
                size=len(part),
                attempt=attempt,
                runs=format_ranges(spans(id_ for group in part for id_ in group)),
            )
        )
    return made


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


def run_ids(plan: PlanSpec, shard: ShardPlan, indexes: Iterable[Span]) -> list[Span]:
    """The run ids of completion indexes of a shard."""
    if not shard.runs:
        packs = [(shard.first_pack + first, shard.first_pack + last) for first, last in indexes]
        return plan.ids_of(packs)
    groups = retry_groups(plan, parse_ranges(shard.runs))
    chosen = (id_ for first, last in indexes for g in groups[first : last + 1] for id_ in g)
    return spans(chosen)
