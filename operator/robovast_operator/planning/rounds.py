"""The next packs of a campaign whose packs are measured (`runs_per_job: auto`). Pure functions.

Each round is a plan of its own that appends to the former: whoever dies, what is planned stays.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate

from robovast.model.packing import Pace, next_packs
from robovast.model.packs import PlanSpec, Round
from robovast_operator.planning.campaign import Revision


def idle_pods(parallelism: int, *, queued: bool) -> int:
    """As many pods must have nothing to do until others are asked for: each time is a write.

    Args:
        parallelism: most pods of the campaign.
        queued: whether its Jobs are Kueue's: they keep the number of pods that they begin with.
    """
    return max(1, parallelism // (2 if queued else 8))


def next_round(newest: Revision, parallelism: int, pace: Pace | None, name: str) -> Revision:
    """The plan with further packs; some runs are in none yet.

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


def last_round(newest: Revision, name: str) -> Revision:
    """The plan with all other runs in packs, of a campaign that executes none of them any more."""
    return _with(newest, Round(runs=_room(newest), size=newest.plan.runs_per_pack), name)


def _room(newest: Revision) -> int:
    """How many of the next runs belong to one object: so do the Jobs of a round."""
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
