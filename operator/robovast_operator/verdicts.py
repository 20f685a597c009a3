"""What is known of runs, from the indexes of Jobs and the last words of pods. Pure functions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from robovast.cluster.plan import PlanSpec
from robovast.cluster.ranges import Span, count, merge, parse_ranges, subtract
from robovast_operator.shards import ShardPlan, run_ids
from robovast_operator.store import JobState


@dataclass(frozen=True)
class Report:
    """The verdicts that an agent leaves as termination message."""

    passed: tuple[Span, ...] = ()
    failed: tuple[Span, ...] = ()
    errored: tuple[Span, ...] = ()


def parse_report(message: str) -> Report | None:
    """The report in a termination message; None when there is none."""
    try:
        data = json.loads(message)
        parts = (tuple(parse_ranges(data.get(k) or "")) for k in ("passed", "failed", "errored"))
        return Report(*parts)
    except (ValueError, AttributeError, TypeError, RecursionError):
        return None


@dataclass(frozen=True)
class Verdicts:
    """Run ids by verdict; ids that are in none have none yet."""

    passed: list[Span]
    failed: list[Span]
    errored: list[Span]

    @property
    def decided(self) -> list[Span]:
        """All runs with a verdict."""
        return merge([*self.passed, *self.failed, *self.errored])


NOTHING = Verdicts([], [], [])


def shard_verdicts(
    plan: PlanSpec, shard: ShardPlan, job: JobState, reports: Mapping[int, Report]
) -> Verdicts:
    """What a shard's Job says of its runs.

    Args:
        plan: of the shard.
        shard: the shard.
        job: its Job.
        reports: what pods of failed indexes said, by index; of an index without, no run is
            stored, so all are errored.
    """
    passed = run_ids(plan, shard, parse_ranges(job.completed))
    failed: list[Span] = []
    errored: list[Span] = []
    for index in (i for a, b in parse_ranges(job.failed) for i in range(a, b + 1)):
        mine = run_ids(plan, shard, [(index, index)])
        report = reports.get(index, Report())
        passed += report.passed
        failed += report.failed
        errored += subtract(mine, [*report.passed, *report.failed])
    if job.finished:
        everything = run_ids(plan, shard, [(0, shard.size - 1)])
        errored += subtract(everything, [*passed, *failed, *errored])
    return Verdicts(merge(passed), merge(failed), merge(errored))


def combine(parts: Iterable[Verdicts]) -> Verdicts:
    """Verdicts in order of time: of a run with several, the last one counts."""
    total = NOTHING
    for part in parts:
        new = part.decided
        total = Verdicts(
            merge([*subtract(total.passed, new), *part.passed]),
            merge([*subtract(total.failed, new), *part.failed]),
            merge([*subtract(total.errored, new), *part.errored]),
        )
    return total


def within(ids: Iterable[Span], first: int, last: int) -> int:
    """How many ids lie between two, both included."""
    return count((max(a, first), min(b, last)) for a, b in ids if a <= last and b >= first)
