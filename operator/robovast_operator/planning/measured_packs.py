"""The next packs of a campaign whose packs are measured (`runs_per_job: auto`). Pure functions.

Each round is a separate plan that appends to the last plan, so plans survive a restart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

from robovast.model.packing import Pace, next_packs
from robovast.model.packs import PlanSpec, Round
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.store import JobState
from robovast_operator.planning.campaign import Revision


@dataclass(frozen=True)
class PlanningRounds:
    """When the next round is planned; where packs are not measured, all runs are in packs."""

    identity: Identity
    newest: Revision
    """The plan so far."""
    open: Sequence[JobState]
    """Running Jobs of shards."""
    parallelism: int
    """Most pods of the campaign."""
    pace: Pace | None
    """What was measured; None if nothing was."""

    @property
    def unpacked(self) -> int:
        """Return how many runs are in no pack yet."""
        return self.newest.plan.total - self.newest.plan.in_packs

    @cached_property
    def pods_of_open(self) -> list[int]:
        """Return how many pods each open Job may have.

        Where packs are measured, not more than it has packs left: the others are another Job's.
        """
        if self.newest.plan.rounds is None:
            return [job.parallelism for job in self.open]
        return [min(job.parallelism, job.left) for job in self.open]

    @property
    def busy(self) -> int:
        """Return how many pods all of them may have."""
        return sum(self.pods_of_open)

    @property
    def idle_pods(self) -> int:
        """Return how many pods must be idle before others are asked for; each time that is a write.

        Jobs in a queue of Kueue keep the number of pods that they begin with.
        """
        if self.newest.plan.rounds is None:
            return 1
        queued = any(job.queue for job in self.open)
        return max(1, self.parallelism // (2 if queued else 8))

    @cached_property
    def next(self) -> Revision | None:
        """Return the plan with a further round if pods would be idle without a round; else None."""
        if not self.unpacked or self._idle < self.idle_pods or self._must_wait:
            return None
        name = self.newest.next_name(self.identity)
        return next_round(self.newest, self.parallelism, self.pace, name)

    @cached_property
    def last(self) -> Revision | None:
        """Return the plan with all remaining runs in packs, for an aborted campaign."""
        if not self.unpacked:
            return None
        room = Round(runs=_room(self.newest), size=self.newest.plan.runs_per_pack)
        return _with(self.newest, room, self.newest.next_name(self.identity))

    @property
    def _idle(self) -> int:
        """Return how many pods the packs that are left do not need."""
        wanted = (min(job.parallelism, job.left) if job.queue else job.left for job in self.open)
        return self.parallelism - sum(wanted)

    @property
    def _must_wait(self) -> bool:
        """Return whether run times are missing, but will soon be measured.

        Times count after half of the first round, because short runs finish first.
        """
        rounds = self.newest.plan.rounds
        half = all(2 * job.left <= job.size for job in self.open)
        measured = self.pace is not None and (half or len(rounds or ()) > 1)
        return bool(rounds and self.open) and not measured


def next_round(newest: Revision, parallelism: int, pace: Pace | None, name: str) -> Revision:
    """Return the plan with further packs; some runs are in none yet.

    Args:
        newest: the plan so far.
        parallelism: most pods of the campaign.
        pace: what was measured; None if nothing was.
        name: of the new plan's ConfigMap.
    """
    plan = newest.plan
    rounds = plan.rounds or ()
    last = rounds[-1].size if rounds else 0
    runs, size = next_packs(plan.total - plan.in_packs, parallelism, last, pace)
    return _with(newest, Round(runs=min(runs, _room(newest)), size=size), name)


def _room(newest: Revision) -> int:
    """Return how many of the next runs belong to the same object, as the Jobs of a round do."""
    plan, first = newest.plan, newest.plan.in_packs
    ends = list(accumulate(block.size for block in plan.blocks))
    at = next(number for number, end in enumerate(ends) if first < end)
    while at + 1 < len(ends) and newest.owners.get(at + 1) == newest.owners.get(at):
        at += 1
    return ends[at] - first


def _with(newest: Revision, round_: Round, name: str) -> Revision:
    given = newest.plan.model_dump(exclude={"rounds"})
    plan = PlanSpec(**given, rounds=(*(newest.plan.rounds or ()), round_))
    return replace(newest, number=newest.number + 1, config_map=name, plan=plan)
