"""One campaign at one moment, and what follows from it at once. Pure functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from robovast.base.ranges import merge
from robovast.kubeapi.status import SHARDS_LIMIT, BadRuns, CampaignStatus, Settled, Shard
from robovast.model.packs import PlanSpec
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.conditions import is_true
from robovast_operator.kube.lenient import ranges
from robovast_operator.kube.store import JobState
from robovast_operator.planning.campaign import Accepted, Revision
from robovast_operator.planning.shards import ShardPlan, first_attempts, repetitions
from robovast_operator.pods.findings import Final, Trouble
from robovast_operator.pods.tries import Tries, number_of
from robovast_operator.pods.verdicts import Report, ShardRuns, Tally, tally_of, total
from robovast_operator.pods.waiting import Waiting


@dataclass(frozen=True)
class Observed:
    """One campaign at one moment."""

    accepted: Accepted
    generation: int
    status: CampaignStatus
    revisions: Sequence[Revision]
    jobs: Mapping[str, JobState]
    now: datetime
    reports: Mapping[str, Mapping[int, Report]] = field(default_factory=dict)
    """By Job, what pods of its failed indexes said."""
    stuck: frozenset[str] = frozenset()
    """Jobs that hold pods which are to go; made anew they go on."""
    withdrawn: frozenset[str] = frozenset()
    """Configurations that are gone, by uid: nothing more is executed of their runs."""
    trouble: Trouble | None = None
    finals: Mapping[str, Final] = field(default_factory=dict)
    """By finish Job, what it found."""
    failures: Mapping[str, Trouble] = field(default_factory=dict)
    """By Job that failed as a whole, why."""
    waiting: Waiting | None = None
    """Why Kueue has not admitted the oldest Job that waits."""
    parked: frozenset[str] = frozenset()
    """Jobs that are out of their queue because the campaign was suspended."""


@dataclass(frozen=True)
class Picture:
    """What follows at once from what is observed."""

    observed: Observed
    shards: tuple[ShardPlan, ...]
    """The shards that are not settled: first attempts, then those that repeat bad runs."""
    records: Mapping[str, Shard]
    """What the status says of shards, by Job."""
    tallies: Mapping[str, Tally]
    """What is known of the shards' runs, by Job."""
    aborted: Trouble | None

    @classmethod
    def of(cls, observed: Observed) -> Picture:
        """The picture of a moment."""
        status = observed.status
        records = {record.job: record for record in status.shards}
        identity, settled = observed.accepted.identity, status.settled
        shards = first_attempts(identity, observed.revisions)[settled.first :]
        if status.bad is not None and status.attempt > status.bad.attempt:
            shards += repetitions(identity, status.bad, status.attempt)[settled.repeated :]
        tallies = {shard.job: _tally(observed, shard, records.get(shard.job)) for shard in shards}
        picture = cls(observed, tuple(shards), records, tallies, None)
        return replace(picture, aborted=_aborted(picture))

    @property
    def plan(self) -> PlanSpec:
        """The newest plan."""
        return self.observed.revisions[-1].plan

    def job(self, shard: ShardPlan) -> JobState | None:
        """The Job of a shard, if it is there."""
        return self.observed.jobs.get(shard.job)

    def runs_of(self, shard: ShardPlan) -> ShardRuns:
        """The runs of a shard."""
        return shard_runs(self.observed, shard)

    def withdrawn(self, shard: ShardPlan) -> bool:
        """Whether the Configuration that asked for a shard is gone, and its Job with it."""
        return shard.owner is not None and shard.owner["uid"] in self.observed.withdrawn

    def ended(self, shard: ShardPlan) -> bool:
        """Whether a shard has come to its end."""
        record, job = self.records.get(shard.job), self.job(shard)
        if self.withdrawn(shard):
            return True
        if record is not None and record.state in {"Complete", "Failed"}:
            return True
        return job is not None and not job.open

    def is_remembered(self, shard: ShardPlan) -> bool:
        """Whether the status says how a shard ended, and how each of its runs did."""
        record = self.records.get(shard.job)
        if record is None or record.state not in {"Complete", "Failed"}:
            return False
        return self.tallies[shard.job].decided == self.runs_of(shard).all

    @property
    def open(self) -> list[JobState]:
        """Jobs of shards that are at work, oldest first."""
        jobs = ((shard, self.job(shard)) for shard in self.shards)
        return [job for shard, job in jobs if job is not None and not self.ended(shard)]

    @property
    def waiting(self) -> list[ShardPlan]:
        """Shards that have no Job yet and may have one: as many as the status can tell of."""
        begun = next((n for n, shard in enumerate(self.shards) if not self.ended(shard)), 0)
        near = self.shards[: begun + SHARDS_LIMIT]
        return [shard for shard in near if self.job(shard) is None and not self.ended(shard)]

    @property
    def held(self) -> Waiting | None:
        """Why the campaign waits for quota, unless a part of it has some."""
        return self.observed.waiting if all(job.suspended for job in self.open) else None

    @property
    def all_ended(self) -> bool:
        """Whether every shard has come to its end, and no Job is left that repeats runs."""
        known = {shard.job for shard in self.shards}
        jobs = self.observed.jobs.values()
        strays = (job for job in jobs if job.role == "shard" and job.name not in known)
        return all(self.ended(shard) for shard in self.shards) and not any(j.open for j in strays)

    @property
    def quiet(self) -> bool:
        """Whether nothing more is to be executed, but for bad runs once more."""
        return self.aborted is not None or self.all_ended

    @property
    def attempt(self) -> int:
        """The current attempt. Without bad runs to repeat, each is done at once."""
        spec, status = self.observed.accepted.spec, self.observed.status
        return (
            status.attempt
            if self.repetition_due and not self.repeats
            else max(spec.attempt, status.attempt)
        )

    @property
    def repetition_due(self) -> bool:
        """Whether bad runs are to be executed once more."""
        none_bad = self.all_known and self.bad is not None and not self.bad.runs
        return self.observed.accepted.spec.attempt > self.observed.status.attempt and not none_bad

    @property
    def repeats(self) -> bool:
        """Whether bad runs are executed once more from now on: it is known which they are."""
        listed = self.all_known and self.bad is not None and bool(self.bad.list)
        return self.repetition_due and listed

    @property
    def over(self) -> bool:
        """Whether nothing more is to be executed."""
        return self.quiet and not self.repetition_due

    @property
    def ended_shards(self) -> int:
        """How many shards have come to their end."""
        return self.observed.status.settled.shards + sum(self.ended(s) for s in self.shards)

    @property
    def finish(self) -> Tries:
        """The Jobs that make the index; another set of shards needs another one."""
        task = self.observed.accepted.identity.child(f"finish-{self.ended_shards}")
        return Tries.of(self.observed.jobs.values(), task)

    @property
    def indexed(self) -> bool:
        """Whether the index in the bucket covers everything that ran."""
        status = self.observed.status
        known = status.finished_shards == self.ended_shards and is_true(status, "ResultsAvailable")
        return self.over and (known or (self.final is not None and self.processed))

    @property
    def process_name(self) -> str:
        """The Job that works the results up; another set of shards needs another one."""
        return self.observed.accepted.identity.child(f"process-{self.ended_shards}")

    @property
    def processed(self) -> bool:
        """Whether the results are worked up, or were tried to be, as far as that is asked for."""
        job = self.observed.jobs.get(self.process_name)
        asked = self.observed.accepted.spec.process_results
        return not asked or (job is not None and not job.open)

    @property
    def final(self) -> Final | None:
        """What the finish Job of these shards found, if it has ended."""
        if not self.quiet:
            return None
        task = self.finish.task
        found = (f for name, f in self.observed.finals.items() if number_of(name, task) is not None)
        return next((final for final in found if final.runs.total == self.plan.total), None)

    @property
    def lost_words(self) -> bool:
        """Whether the finish Job ended well, and nobody could read what it found."""
        last = self.finish.last
        ended = last is not None and last.finished == "Complete" and not last.deleting
        return ended and self.over and not self.indexed and self.final is None

    @property
    def bad(self) -> BadRuns | None:
        """What the last index of the bucket says of bad runs."""
        status, final = self.observed.status, self.final
        if final is None:
            return status.bad
        return BadRuns(
            shards=self.ended_shards,
            total=final.runs.total,
            attempt=status.attempt,
            plan=self.observed.revisions[-1].config_map,
            runs=final.runs.failed + final.runs.errored,
            list=final.list,
            sizes=final.sizes,
        )

    @property
    def all_known(self) -> bool:
        """Whether that index covers everything that ran."""
        bad = self.bad
        covered = (self.ended_shards, self.plan.total)
        return self.quiet and bad is not None and (bad.shards, bad.total) == covered

    @property
    def settled(self) -> Settled:
        """The shards that are remembered as numbers from now on: those that the index covers."""
        settled, final = self.observed.status.settled, self.final
        if final is not None:
            settled = Settled(
                shards=self.ended_shards,
                first=len(first_attempts(self.observed.accepted.identity, self.observed.revisions)),
                passed=final.runs.passed,
                failed=final.runs.failed,
                errored=final.runs.errored,
            )
        if self.repeats:  # what was bad has no verdict now
            settled = settled.model_copy(update={"failed": 0, "errored": 0, "repeated": 0})
        return settled

    @property
    def tally(self) -> Tally:
        """What is known of all runs now."""
        settled = self.observed.status.settled
        before = Tally(settled.passed, settled.failed, settled.errored)
        return total([before, *self.tallies.values()])

    @property
    def undecided(self) -> int:
        """How many runs have ended without a verdict that is known."""
        return sum(self._undecided(shard) for shard in self.shards)

    def _undecided(self, shard: ShardPlan) -> int:
        runs, job = self.runs_of(shard), self.job(shard)
        if self.ended(shard):
            ended = runs.all
        elif job is not None:
            ended = runs.number(
                merge([*ranges(job.completed, shard.size), *ranges(job.failed, shard.size)])
            )
        else:
            return 0
        return max(0, ended - self.tallies[shard.job].decided)


def shard_runs(observed: Observed, shard: ShardPlan) -> ShardRuns:
    """The runs of a shard."""
    bad = observed.status.bad
    sizes = GroupSizes.parse(bad.sizes if bad is not None else "")
    return ShardRuns(observed.revisions[-1].plan, shard, sizes)


def _tally(observed: Observed, shard: ShardPlan, record: Shard | None) -> Tally:
    """What is known of a shard's runs: of one that has ended from the status, else from its Job."""
    job = observed.jobs.get(shard.job)
    if record is not None and record.state in {"Complete", "Failed"}:
        return Tally(record.passed, record.failed, record.errored)
    if job is None:
        return Tally()
    return tally_of(shard_runs(observed, shard), job, observed.reports.get(job.name, {}))


def _aborted(picture: Picture) -> Trouble | None:
    """Why the campaign is given up, if it is."""
    status, limits = picture.observed.status, picture.observed.accepted.spec.fail_fast
    for condition in status.conditions:
        if condition.type == "Succeeded" and condition.status == "False":
            return Trouble(condition.reason, condition.message, final=True)
    trouble = picture.observed.trouble
    if trouble is not None and trouble.final:
        return trouble
    known = picture.tally
    for name, limit, found in (
        ("failed", limits.max_failed, known.failed),
        ("errored", limits.max_errored, known.errored),
    ):
        if limit is not None and found > limit and not picture.all_ended:
            message = f"{found} runs have {name}; spec.failFast allows {limit}"
            return Trouble("FailFast", message, final=True)
    return None
