"""Verdicts of runs, from the indexes of Jobs and the messages of pods. Pure functions.

A run has a verdict when a pod has reported one. A failed index without a report (its pod is not
listed yet, is deleted, or its message was cut) is undecided: the finish Job reads the bucket.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from robovast.base.ranges import Span, clip, contains, count, merge, shift, subtract
from robovast.model.packs import PlanSpec
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.store import JobState
from robovast_operator.kube.untrusted_fields import ranges
from robovast_operator.planning.shards import ShardPlan


@dataclass(frozen=True)
class Tally:
    """Runs with a verdict, and some ids of those that are bad."""

    passed: int = 0
    failed: int = 0
    errored: int = 0
    failed_ids: tuple[Span, ...] = ()
    errored_ids: tuple[Span, ...] = ()
    not_needed: int = 0
    """Further runs that are not executed, since these have decided."""

    @property
    def settled(self) -> int:
        """Return the number of runs with a final state."""
        return self.passed + self.failed + self.errored + self.not_needed


@dataclass(frozen=True)
class Report(Tally):
    """The verdicts that an agent leaves as termination message."""

    final: bool = False
    """Whether no pod of the index comes after it: what has no verdict is errored then."""
    stored: bool = False
    """Whether the agent has stored all runs of the index: they count, whatever the pod does."""


def total(parts: Iterable[Tally]) -> Tally:
    """Add tallies of different runs."""
    tallies = list(parts)
    return Tally(
        sum(part.passed for part in tallies),
        sum(part.failed for part in tallies),
        sum(part.errored for part in tallies),
        tuple(merge(span for part in tallies for span in part.failed_ids)),
        tuple(merge(span for part in tallies for span in part.errored_ids)),
        sum(part.not_needed for part in tallies),
    )


@dataclass(frozen=True)
class ShardRuns:
    """Which runs a shard's completion indexes are."""

    plan: PlanSpec
    shard: ShardPlan
    sizes: GroupSizes
    """Of a repetition's groups."""

    def number(self, indexes: Iterable[Span]) -> int:
        """Return how many runs some indexes have."""
        inside = clip(indexes, 0, self.shard.size - 1)
        packs = shift(inside, self.shard.first_pack)
        return self.sizes.runs_of(packs) if self.shard.repeat else count(self.plan.ids_of(packs))

    @property
    def all(self) -> int:
        """Return how many runs the shard has."""
        return self.number([(0, self.shard.size - 1)])

    def ids(self, index: int) -> list[Span]:
        """Return the run ids of an index; empty for a repetition, whose ids are in the bucket."""
        pack = self.shard.first_pack + index
        return [] if self.shard.repeat else self.plan.ids_of([(pack, pack)])


def tally_of(runs: ShardRuns, job: JobState, reports: Mapping[int, Report]) -> Tally:
    """Count the verdicts of a shard, from its Job and pods.

    Args:
        runs: of the shard.
        job: its Job.
        reports: of the pods of failed indexes, by index; if not all runs are needed, also
            those of completed ones.
    """
    size = runs.shard.size
    failed = ranges(job.failed, size)
    completed = subtract(ranges(job.completed, size), failed)
    covered = merge([*failed, *completed]) if runs.plan.by_variant else failed
    reported = [
        _index_tally(runs, index, report)
        for index, report in reports.items()
        if contains(covered, index) or (report.stored and not contains(completed, index))
    ]
    passed = 0 if runs.plan.by_variant else runs.number(completed)
    return total([Tally(passed=passed), *reported])


def _index_tally(runs: ShardRuns, index: int, report: Report) -> Tally:
    """Count the verdicts in a report of an index; ignore a report with too many runs."""
    number, mine = runs.number([(index, index)]), runs.ids(index)
    left = number - report.settled
    if left < 0:
        return Tally()
    errored_ids = report.errored_ids
    if report.final and left and number == 1:
        errored_ids = tuple(mine)
    bounds = (mine[0][0], mine[-1][1]) if mine else (0, runs.plan.total - 1)
    return Tally(
        report.passed,
        report.failed,
        report.errored + (left if report.final else 0),
        tuple(clip(report.failed_ids, *bounds)),
        tuple(clip(errored_ids, *bounds)),
        report.not_needed,
    )
