"""One campaign at one moment, and what follows from it at once. Pure functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from robovast.cluster.plan import PlanSpec
from robovast.cluster.ranges import Span, count, merge, parse_ranges, subtract
from robovast.cluster.status import CampaignStatus, Runs, Shard
from robovast_operator.campaign import Accepted, Revision
from robovast_operator.conditions import is_true
from robovast_operator.shards import ShardPlan, first_attempts, repetitions, run_ids
from robovast_operator.store import JobState
from robovast_operator.verdicts import Report, Verdicts, combine, shard_verdicts
from robovast_operator.waiting import Waiting


@dataclass(frozen=True)
class Trouble:
    """Why nothing moves, or why a campaign cannot go on."""

    reason: str
    """One word."""
    message: str
    final: bool = False
    """Whether the campaign is given up."""
    repeated: bool = False
    """Whether pods that start die of it, too, one after the other."""


@dataclass(frozen=True)
class Final:
    """What the finish Job found in the bucket."""

    runs: Runs
    failed: str
    errored: str
    truncated: bool
    failing: tuple[str, ...]


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
    """All shards, those that bad runs are repeated in last."""
    records: Mapping[str, Shard]
    """What the status says of shards, by Job."""
    verdicts: Verdicts
    aborted: Trouble | None

    @classmethod
    def of(cls, observed: Observed) -> Picture:
        """The picture of a moment."""
        accepted, status = observed.accepted, observed.status
        records = {record.job: record for record in status.shards}
        shards = first_attempts(accepted.identity, observed.revisions)
        shards += _repeated(observed)
        shards += _new_repetitions(observed, shards, records)
        verdicts = _verdicts(observed, shards, records)
        return cls(observed, tuple(shards), records, verdicts, _aborted(observed, verdicts))

    @property
    def plan(self) -> PlanSpec:
        """The newest plan."""
        return self.observed.revisions[-1].plan

    def job(self, shard: ShardPlan) -> JobState | None:
        """The Job of a shard, if it is there."""
        return self.observed.jobs.get(shard.job)

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
        mine = run_ids(self.plan, shard, [(0, shard.size - 1)])
        return not subtract(mine, self.verdicts.decided)

    @property
    def open(self) -> list[JobState]:
        """Jobs of shards that are at work, oldest first."""
        jobs = ((shard, self.job(shard)) for shard in self.shards)
        return [job for shard, job in jobs if job is not None and not self.ended(shard)]

    @property
    def waiting(self) -> list[ShardPlan]:
        """Shards that have no Job yet and may have one."""
        return [
            shard
            for shard in self.shards
            if self.job(shard) is None
            and not self.ended(shard)
            and (shard.attempt == 1 or shard.job in self.records)
        ]

    @property
    def held(self) -> Waiting | None:
        """Why the campaign waits for quota, unless a part of it has some."""
        return self.observed.waiting if all(job.suspended for job in self.open) else None

    @property
    def all_ended(self) -> bool:
        """Whether every shard has come to its end."""
        return all(self.ended(shard) for shard in self.shards)

    @property
    def repetition_due(self) -> bool:
        """Whether bad runs are to be executed once more."""
        return self.observed.accepted.spec.attempt > self.observed.status.attempt

    @property
    def over(self) -> bool:
        """Whether nothing more is to be executed."""
        if self.repetition_due:
            return False
        return self.aborted is not None or self.all_ended

    @property
    def ended_shards(self) -> int:
        """How many shards have come to their end."""
        return sum(self.ended(shard) for shard in self.shards)

    @property
    def finish_name(self) -> str:
        """The Job that makes the index; another set of shards needs another one."""
        return self.observed.accepted.identity.child(f"finish-{self.ended_shards}")

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
        return self.observed.finals.get(self.finish_name)


def _repeated(observed: Observed) -> list[ShardPlan]:
    """The shards in which bad runs are executed once more, as the status remembers them."""
    identity = observed.accepted.identity
    made = []
    for record in observed.status.shards:
        if record.attempt == 1:
            continue
        revision = next(r for r in observed.revisions if r.config_map == record.plan)
        (shard,) = repetitions(
            identity, revision, record.attempt, parse_ranges(record.runs), record.index
        )
        made.append(replace(shard, job=record.job))
    return made


def _new_repetitions(
    observed: Observed, shards: Sequence[ShardPlan], records: Mapping[str, Shard]
) -> list[ShardPlan]:
    """Shards for the bad runs, when their repetition is asked for and all else has ended."""
    status, spec = observed.status, observed.accepted.spec
    ended = all(
        (record := records.get(shard.job)) is not None and record.state in {"Complete", "Failed"}
        for shard in shards
    )
    if spec.attempt <= status.attempt or not (ended or _was_aborted(status)):
        return []
    bad = merge([*parse_ranges(status.failed_runs), *parse_ranges(status.errored_runs)])
    first = max((shard.index for shard in shards), default=-1) + 1
    revision = observed.revisions[-1]
    return repetitions(observed.accepted.identity, revision, spec.attempt, bad, first)


def _was_aborted(status: CampaignStatus) -> bool:
    return any(c.type == "Succeeded" and c.status == "False" for c in status.conditions)


def _verdicts(
    observed: Observed, shards: Sequence[ShardPlan], records: Mapping[str, Shard]
) -> Verdicts:
    """All verdicts: of shards that have ended from the status, of others from their Jobs."""
    plan = observed.revisions[-1].plan
    status = observed.status
    settled: list[Span] = []
    live: list[Verdicts] = []
    for shard in shards:
        record, job = records.get(shard.job), observed.jobs.get(shard.job)
        if record is not None and record.state in {"Complete", "Failed"}:
            settled += run_ids(plan, shard, [(0, shard.size - 1)])
        elif job is not None:
            live.append(shard_verdicts(plan, shard, job, observed.reports.get(job.name, {})))
    settled = merge(settled)
    failed = _common(parse_ranges(status.failed_runs), settled)
    errored = _common(parse_ranges(status.errored_runs), settled)
    remembered = Verdicts(subtract(settled, [*failed, *errored]), failed, errored)
    return combine([remembered, *live])


def _common(some: Sequence[Span], others: Sequence[Span]) -> list[Span]:
    return subtract(some, subtract(some, others))


def _aborted(observed: Observed, verdicts: Verdicts) -> Trouble | None:
    """Why the campaign is given up, if it is."""
    status, spec = observed.status, observed.accepted.spec
    if spec.attempt > status.attempt:
        return None
    for condition in status.conditions:
        if condition.type == "Succeeded" and condition.status == "False":
            return Trouble(condition.reason, condition.message, final=True)
    if observed.trouble is not None and observed.trouble.final:
        return observed.trouble
    limits = spec.fail_fast
    for name, limit, ids in (
        ("failed", limits.max_failed, verdicts.failed),
        ("errored", limits.max_errored, verdicts.errored),
    ):
        if limit is not None and count(ids) > limit:
            message = f"{count(ids)} runs have {name}; spec.failFast allows {limit}"
            return Trouble("FailFast", message, final=True)
    return None
