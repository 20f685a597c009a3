"""The heart of the operator: what is to be done for a campaign, from what is there.

`decide` is pure: it looks at one moment and knows no history but the status. Whatever happened
in between, whatever was lost, the same picture leads to the same actions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from typing import Literal

from robovast.cluster.plan import PlanSpec
from robovast.cluster.ranges import (
    Span,
    count,
    format_ranges,
    merge,
    parse_ranges,
    subtract,
    truncate,
)
from robovast.cluster.status import RANGES_LIMIT, CampaignStatus, Runs, Shard
from robovast_operator.campaign import Accepted, Revision
from robovast_operator.conditions import Facts, Why, campaign_conditions, campaign_state, is_true
from robovast_operator.shards import (
    ShardPlan,
    first_attempts,
    next_shards,
    repetitions,
    run_ids,
)
from robovast_operator.store import JobState
from robovast_operator.times import format_time, parse_time
from robovast_operator.verdicts import Report, Verdicts, combine, shard_verdicts


@dataclass(frozen=True)
class Trouble:
    """Why nothing moves, or why a campaign cannot go on."""

    reason: str
    """One word."""
    message: str
    final: bool = False
    """Whether the campaign is given up."""


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
    trouble: Trouble | None = None
    finals: Mapping[str, Final] = field(default_factory=dict)
    """By finish Job, what it found."""
    quota: Trouble | None = None
    """Why Kueue has not admitted the oldest open Job."""


@dataclass(frozen=True)
class CreateShard:
    """Make the Job of a shard."""

    shard: ShardPlan


@dataclass(frozen=True)
class CreateTask:
    """Make the Job of our own work on the whole campaign."""

    command: str
    name: str
    plan: str


@dataclass(frozen=True)
class SuspendJob:
    """Stop or resume the pods of a Job."""

    job: str
    suspend: bool


@dataclass(frozen=True)
class ResizeJob:
    """Change how many pods a Job may have."""

    job: str
    parallelism: int


@dataclass(frozen=True)
class DeleteJob:
    """Remove a Job and its pods."""

    job: str


Action = CreateShard | CreateTask | SuspendJob | ResizeJob | DeleteJob


@dataclass(frozen=True)
class Decision:
    """What is to be done, and what is to be told."""

    status: CampaignStatus
    actions: tuple[Action, ...] = ()
    """Carried out before the status is written."""
    later: tuple[Action, ...] = ()
    """Carried out once the status is written: what they remove is remembered there."""
    again: float | None = None
    """When to look again although nothing happens [s]."""


def decide(observed: Observed) -> Decision:
    """The next steps of an accepted campaign."""
    picture = _Picture.of(observed)
    actions = [*_open_jobs(picture), *_new_jobs(picture)]
    created = [action.shard for action in actions if isinstance(action, CreateShard)]
    status = _status(picture, created)
    later = [*_cancel(picture), *_expire(picture)]
    return Decision(status, tuple(actions), tuple(later), _again(picture))


@dataclass(frozen=True)
class _Picture:
    """What follows at once from what is observed."""

    observed: Observed
    shards: tuple[ShardPlan, ...]
    """All shards, those that bad runs are repeated in last."""
    records: Mapping[str, Shard]
    """What the status says of shards, by Job."""
    verdicts: Verdicts
    aborted: Trouble | None

    @classmethod
    def of(cls, observed: Observed) -> _Picture:
        accepted, status = observed.accepted, observed.status
        records = {record.job: record for record in status.shards}
        shards = first_attempts(accepted.identity, observed.revisions)
        shards += _repeated(observed)
        shards += _new_repetitions(observed, shards, records)
        verdicts = _verdicts(observed, shards, records)
        return cls(observed, tuple(shards), records, verdicts, _aborted(observed, verdicts))

    @property
    def plan(self) -> PlanSpec:
        return self.observed.revisions[-1].plan

    def job(self, shard: ShardPlan) -> JobState | None:
        return self.observed.jobs.get(shard.job)

    def ended(self, shard: ShardPlan) -> bool:
        """Whether a shard has come to its end."""
        record, job = self.records.get(shard.job), self.job(shard)
        if record is not None and record.state in {"Complete", "Failed"}:
            return True
        return job is not None and not job.open

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
    def all_ended(self) -> bool:
        return all(self.ended(shard) for shard in self.shards)

    @property
    def repetition_due(self) -> bool:
        return self.observed.accepted.spec.attempt > self.observed.status.attempt

    @property
    def over(self) -> bool:
        """Whether nothing more is to be executed."""
        if self.repetition_due:
            return False
        return self.aborted is not None or self.all_ended

    @property
    def ended_shards(self) -> int:
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
        return self.over and (known or self.final is not None)

    @property
    def final(self) -> Final | None:
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


def _open_jobs(picture: _Picture) -> list[Action]:
    """Changes of Jobs that are at work."""
    spec = picture.observed.accepted.spec
    if picture.over:
        return []
    wrong = [job for job in picture.open if job.suspended != spec.suspend and not job.deleting]
    if spec.queue_name is not None:  # Kueue owns the field: it is asked, not overruled
        wrong = [job for job in wrong if spec.suspend]
    actions: list[Action] = [SuspendJob(job.name, spec.suspend) for job in wrong]
    return actions + _resize(picture)


def _resize(picture: _Picture) -> list[Action]:
    """The only open Job follows `parallelism`; Kueue has counted on what it admitted."""
    spec = picture.observed.accepted.spec
    if spec.queue_name is not None or len(picture.open) != 1 or picture.waiting:
        return []
    (job,) = picture.open
    size = next(shard.size for shard in picture.shards if shard.job == job.name)
    wanted = min(size, spec.parallelism)
    return [] if job.parallelism == wanted else [ResizeJob(job.name, wanted)]


def _new_jobs(picture: _Picture) -> list[Action]:
    spec = picture.observed.accepted.spec
    if spec.suspend:
        return []
    if not picture.over:
        pods = [job.parallelism for job in picture.open]
        chosen = next_shards(picture.waiting, pods, spec.parallelism)
        return [CreateShard(shard) for shard in chosen]
    if picture.indexed or picture.finish_name in picture.observed.jobs or _cancel(picture):
        return []
    plan = picture.observed.revisions[-1].config_map
    return [CreateTask("finish", picture.finish_name, plan)]


def _cancel(picture: _Picture) -> list[Action]:
    """Of a campaign that was given up, what is still at work goes."""
    if picture.aborted is None or picture.repetition_due:
        return []
    jobs = picture.observed.jobs
    return [
        DeleteJob(shard.job)
        for shard in picture.shards
        if (job := jobs.get(shard.job)) is not None and job.open and not job.deleting
    ]


def _expiry(picture: _Picture) -> datetime | None:
    """When the Jobs of a finished campaign go."""
    ttl = picture.observed.accepted.spec.ttl_seconds_after_finished
    ended = picture.observed.status.completion_time
    if ttl is None or ended is None or not picture.indexed:
        return None
    return parse_time(ended) + timedelta(seconds=ttl)


def _expire(picture: _Picture) -> list[Action]:
    expiry = _expiry(picture)
    if expiry is None or picture.observed.now < expiry:
        return []
    return [DeleteJob(job.name) for job in picture.observed.jobs.values() if not job.deleting]


def _again(picture: _Picture) -> float | None:
    expiry = _expiry(picture)
    if expiry is None or not picture.observed.jobs:
        return None
    return max(1.0, (expiry - picture.observed.now).total_seconds())


def _status(picture: _Picture, created: Sequence[ShardPlan]) -> CampaignStatus:
    observed, old = picture.observed, picture.observed.status
    accepted = observed.accepted
    records = _records(picture, created)
    runs, failed, errored, truncated, failing = _numbers(picture)
    indexed = picture.indexed
    started = old.start_time or (format_time(observed.now) if records else None)
    ended = format_time(observed.now) if picture.over and not picture.repetition_due else None
    status = CampaignStatus(
        observed_generation=observed.generation,
        progress=f"{runs.passed + runs.failed + runs.errored}/{runs.total}",
        campaign=accepted.campaign,
        bucket=accepted.bucket,
        endpoint=accepted.endpoint,
        image=accepted.image,
        attempt=max([1, *(record.attempt for record in records)]),
        runs=runs,
        failed_runs=failed,
        errored_runs=errored,
        ranges_truncated=truncated,
        failing=list(failing),
        shards=records,
        finished_shards=picture.ended_shards if indexed else old.finished_shards,
        start_time=started,
        completion_time=(old.completion_time or ended) if ended else None,
    )
    if picture.repetition_due and not any(r.attempt == accepted.spec.attempt for r in records):
        # nothing was bad, so there is nothing to repeat
        if picture.all_ended:
            status = status.model_copy(update={"attempt": accepted.spec.attempt})
    else:
        status = status.model_copy(update={"attempt": max(status.attempt, old.attempt)})
    facts = Facts(
        generation=observed.generation,
        now=format_time(observed.now),
        spec=accepted.spec,
        runs=runs,
        active=bool(picture.open),
        over=picture.over,
        indexed=indexed,
        aborted=_why(picture.aborted),
        trouble=_why(observed.trouble),
        quota=_why(observed.quota),
    )
    conditions = campaign_conditions(facts, old.conditions)
    return status.model_copy(
        update={"conditions": conditions, "state": campaign_state(facts, conditions)}
    )


def _why(trouble: Trouble | None) -> Why | None:
    return None if trouble is None else (trouble.reason, trouble.message)


def _records(picture: _Picture, created: Sequence[ShardPlan]) -> list[Shard]:
    """Shards that the status remembers: they have a Job, had one, or repeat bad runs."""
    made = {shard.job for shard in created}
    records = []
    for shard in picture.shards:
        record, job = picture.records.get(shard.job), picture.job(shard)
        known = record is not None or job is not None or shard.job in made or shard.attempt > 1
        if not known:
            continue
        records.append(
            Shard(
                index=shard.index,
                job=shard.job,
                state=_record_state(picture, shard, record, job, shard.job in made),
                packs=shard.packs,
                attempt=shard.attempt,
                runs=shard.runs,
                configuration=shard.configuration,
                plan=shard.plan,
            )
        )
    return records


def _record_state(
    picture: _Picture, shard: ShardPlan, record: Shard | None, job: JobState | None, made: bool
) -> Literal["Waiting", "Open", "Complete", "Failed"]:
    if record is not None and record.state in {"Complete", "Failed"}:
        return record.state
    if job is not None and not job.open:
        good = job.finished == "Complete" or job.reason == "FailedIndexes"
        return "Complete" if good else "Failed"
    if picture.aborted is not None and (job is not None or record is not None):
        return "Failed"
    return "Open" if job is not None or made or shard.attempt == 1 else "Waiting"


def _numbers(picture: _Picture) -> tuple[Runs, str, str, bool, Sequence[str]]:
    """Counts and bad runs: as the Jobs say, and in the end as the bucket says."""
    observed, verdicts = picture.observed, picture.verdicts
    final = picture.final
    if final is not None and picture.over:
        return final.runs, final.failed, final.errored, final.truncated, final.failing
    old = observed.status
    if picture.indexed and old.finished_shards == picture.ended_shards:
        return old.runs, old.failed_runs, old.errored_runs, old.ranges_truncated, old.failing
    errored = verdicts.errored
    if picture.aborted is not None:
        errored = merge([*errored, *_cancelled(picture)])
    runs = Runs(
        total=picture.plan.total,
        active=sum(job.active for job in picture.open),
        passed=count(verdicts.passed),
        failed=count(verdicts.failed),
        errored=count(errored),
        stored=count(verdicts.passed) + count(verdicts.failed),
    )
    failed_text, failed_cut = truncate(format_ranges(verdicts.failed), RANGES_LIMIT)
    errored_text, errored_cut = truncate(format_ranges(errored), RANGES_LIMIT)
    cut = failed_cut or errored_cut or old.ranges_truncated
    return runs, failed_text, errored_text, cut, ()


def _cancelled(picture: _Picture) -> list[Span]:
    """Runs that were under way when the campaign was given up."""
    opened = [shard for shard in picture.shards if picture.job(shard) is not None]
    ids = [s for shard in opened for s in run_ids(picture.plan, shard, [(0, shard.size - 1)])]
    return subtract(ids, picture.verdicts.decided)
