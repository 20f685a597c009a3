"""The heart of the operator: decides what to do for a campaign, given a snapshot of it.

`decide` is pure: it looks at one moment and knows no history but the status.
The same snapshot always leads to the same actions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from robovast.kubeapi.status import CampaignStatus
from robovast_operator.kube.events import EventContent
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import parse_time
from robovast_operator.planning.campaign import Revision
from robovast_operator.planning.shards import WINDOW, ShardPlan, next_shards
from robovast_operator.snapshot import Snapshot
from robovast_operator.status.progress_events import progress_events
from robovast_operator.status.status import campaign_status


@dataclass(frozen=True)
class CreateShard:
    """Make the Job of a shard."""

    shard: ShardPlan


@dataclass(frozen=True)
class CreateTask:
    """Make the Job of a task on the whole campaign, such as the index."""

    command: str
    name: str
    plan: str
    beside: frozenset[str] = frozenset()
    """Jobs that are executed meanwhile; the pods of others must have stored what they have."""


@dataclass(frozen=True)
class CreateUpload:
    """Make the Job that uploads the results to the campaign's share."""

    name: str


@dataclass(frozen=True)
class AppendRuns:
    """Fix in a plan the runs that a search has proposed, or the next packs."""

    plan: Revision


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


@dataclass(frozen=True)
class DeletePlan:
    """Remove the ConfigMap of a plan."""

    config_map: str


DEFAULT_QUEUE = "default"
"""Kueue puts Jobs without a queue into the one of this name, where there is one."""

Action = (
    CreateShard
    | CreateTask
    | CreateUpload
    | AppendRuns
    | SuspendJob
    | ResizeJob
    | DeleteJob
    | DeletePlan
)


@dataclass(frozen=True)
class CampaignDecision:
    """The actions to take, and the status to write."""

    status: CampaignStatus
    actions: tuple[Action, ...] = ()
    """Carried out before the status is written."""
    later: tuple[Action, ...] = ()
    """Actions to take after the status is written, since the status keeps what they remove."""
    events: tuple[EventContent, ...] = ()
    """Kubernetes Events to create with the status."""
    again: float | None = None
    """When to reconcile again even if nothing changes [s]."""


def decide(snapshot: Snapshot) -> CampaignDecision:
    """Return the next steps of an accepted campaign."""
    actions = [*_open_jobs(snapshot), *_new_jobs(snapshot), *_upload(snapshot)]
    created = [action.shard for action in actions if isinstance(action, CreateShard)]
    status = campaign_status(snapshot, created)
    later = [*_cancel(snapshot), *_withdraw(snapshot), *_tidy(snapshot), *_expire(snapshot)]
    events = tuple(progress_events(snapshot, status))
    return CampaignDecision(status, tuple(actions), tuple(later), events, _again(snapshot))


def _open_jobs(snapshot: Snapshot) -> list[Action]:
    """Return changes to Jobs that are running."""
    if snapshot.quiet:
        return []
    outdated = [job for job in snapshot.open if _must_be_replaced(snapshot, job)]
    others = [job for job in snapshot.open if job not in outdated and not job.deleting]
    wrong = [job for job in others if _must_be_switched(snapshot, job)]
    suspend = snapshot.accepted.spec.suspend
    switched = [SuspendJob(job.name, suspend) for job in wrong]
    return [*switched, *(_replaced(snapshot, job) for job in outdated), *_resize(snapshot)]


def _must_be_switched(snapshot: Snapshot, job: JobState) -> bool:
    """Return whether a Job must be suspended or resumed; Kueue does so for Jobs in its queues."""
    suspend = snapshot.accepted.spec.suspend
    if not job.queue:
        return job.suspended != suspend
    return suspend != (job.name in snapshot.queue.parked) and (suspend or job.suspended)


def _must_be_replaced(snapshot: Snapshot, job: JobState) -> bool:
    """Return whether a Job must be replaced: it holds deleted pods, or waits in a wrong place.

    A Job that another cluster starts again must also be replaced, because its counts must not
    decrease and it must not wait for a lost cluster. So must a Job that waits for this cluster
    although its queue leads to other clusters.
    """
    spec = snapshot.accepted.spec
    if job.deleting or (job.elsewhere and spec.suspend):
        return False
    right = {"", DEFAULT_QUEUE} if spec.queue_name is None else {spec.queue_name}
    wrong = job.queue not in right or job.priority != (spec.queue_priority_class_name or "")
    lost = job.elsewhere and job.begun
    waiting = snapshot.queue.waiting
    misled = waiting is not None and waiting.misled and waiting.job == job.name
    return job.name in snapshot.pods.stuck or (job.suspended and (wrong or lost or misled))


def _replaced(snapshot: Snapshot, job: JobState) -> Action:
    """Replace a Job.

    One that another cluster may still have gets a successor of another name, and is deleted when
    that is there: of two Jobs of one name, one after the other, Kueue takes one for the other.
    """
    if not job.elsewhere:
        return DeleteJob(job.name)
    shard = next(shard for shard in snapshot.shards if snapshot.job(shard) is job)
    name = snapshot.tries(shard).next_name
    return CreateShard(replace(shard, job=name, parallelism=job.parallelism))


def _resize(snapshot: Snapshot) -> list[Action]:
    """Let the last open Jobs share `parallelism`; a Job that Kueue admitted keeps its size."""
    spec = snapshot.accepted.spec
    if any(job.queue for job in snapshot.open):
        return _shrink(snapshot)
    if snapshot.not_begun:
        return []
    free = spec.parallelism - snapshot.rounds.busy
    if 0 < free < snapshot.rounds.idle_pods:
        return []
    return _grow(snapshot.open, free) if free > 0 else _cut(snapshot.open, spec.parallelism)


def _grow(jobs: Sequence[JobState], free: int) -> list[Action]:
    """Give the pods that ended Jobs no longer need to Jobs with more packs left than pods."""
    actions: list[Action] = []
    for job in jobs:
        more = min(free, job.left - job.parallelism)
        if more > 0:
            actions.append(ResizeJob(job.name, job.parallelism + more))
            free -= more
    return actions


def _cut(jobs: Sequence[JobState], parallelism: int) -> list[Action]:
    """Reduce the only open Job to the allowed number of pods."""
    too_many = len(jobs) == 1 and jobs[0].parallelism > parallelism
    return [ResizeJob(jobs[0].name, parallelism)] if too_many else []


def _shrink(snapshot: Snapshot) -> list[Action]:
    """Reduce a waiting Job to the number of pods that its queue and the campaign allow."""
    waiting, spec = snapshot.queue.waiting, snapshot.accepted.spec
    job = next((job for job in snapshot.open if waiting and job.name == waiting.job), None)
    if waiting is None or job is None:
        return []
    others = sum(other.parallelism for other in snapshot.open if other is not job)
    limits = [job.parallelism, spec.parallelism - others]
    wanted = max(1, min(limits if waiting.fits is None else [*limits, waiting.fits]))
    return [] if job.parallelism == wanted else [ResizeJob(job.name, wanted)]


def _new_jobs(snapshot: Snapshot) -> list[Action]:
    spec = snapshot.accepted.spec
    if spec.suspend:
        return []
    if snapshot.packing is not None:
        return [AppendRuns(snapshot.packing)]
    if not snapshot.quiet:
        return [*_next_proposal(snapshot), *_further_shards(snapshot)]
    if snapshot.repetition_due and snapshot.all_indexed:
        return []
    return [] if snapshot.indexed or _at_work(snapshot) else _last_jobs(snapshot)


def _further_shards(snapshot: Snapshot) -> list[Action]:
    """Return the next shards, as far as there are pods for them.

    Where packs are measured, those of a round take the pods that the former one no longer needs.
    """
    spec, rounds = snapshot.accepted.spec, snapshot.plan.rounds is not None
    pods, waiting = snapshot.rounds.pods_of_open, snapshot.not_begun
    chosen = next_shards(waiting, pods, spec.parallelism, alone=rounds)
    if spec.queue_name is not None or any(job.queue for job in snapshot.open):
        # at most one waits, so that other campaigns have their turn
        chosen = [] if any(job.suspended for job in snapshot.open) else chosen[:1]
    return [CreateShard(shard) for shard in chosen]


def _next_proposal(snapshot: Snapshot) -> list[Action]:
    """Propose further runs of a search when the awaited runs have finished; append the runs."""
    at_work = {job.name for job in _at_work(snapshot)}
    if not snapshot.due_to_propose:
        return []
    if any(job and job.name in at_work for job in map(snapshot.job, snapshot.awaited)):
        return []
    growth = snapshot.search.growth
    if isinstance(growth, Revision):
        return [AppendRuns(growth)]
    jobs, plan = snapshot.search.proposing, snapshot.revisions[-1].config_map
    due = jobs.last is None or (snapshot.lost_proposal and not _pause(snapshot))
    return [CreateTask("propose", jobs.next_name, plan, frozenset(at_work))] if due else []


def _last_jobs(snapshot: Snapshot) -> list[Action]:
    """Create the index when all runs have finished, then process the results."""
    plan, jobs = snapshot.revisions[-1].config_map, snapshot.jobs
    if snapshot.final is None:
        finish = snapshot.finish
        due = finish.last is None or (snapshot.lost_summary and not _pause(snapshot))
        return [CreateTask("finish", finish.next_name, plan)] if due else []
    process = CreateTask("process", snapshot.process_name, plan)
    return [] if snapshot.process_name in jobs else [process]


def _upload(snapshot: Snapshot) -> list[Action]:
    """Upload complete results; the status records the upload after the Job was created."""
    due = snapshot.results if snapshot.status.shared != snapshot.results else ""
    if not due or snapshot.accepted.spec.share is None:
        return []
    return [CreateUpload(snapshot.accepted.identity.child(f"share-{due}"))]


def _pause(snapshot: Snapshot) -> float | None:
    """Return pause before a task is repeated whose termination message is lost [s]; else None."""
    if snapshot.lost_proposal:
        return snapshot.search.proposing.wait(snapshot.now)
    return snapshot.finish.wait(snapshot.now) if snapshot.lost_summary else None


def _cancel(snapshot: Snapshot) -> list[Action]:
    """Delete the running Jobs of an aborted campaign."""
    if snapshot.aborted is None or snapshot.repeats:
        return []
    return [DeleteJob(job.name) for job in _at_work(snapshot) if not job.deleting]


def _at_work(snapshot: Snapshot) -> list[JobState]:
    """Return Jobs of shards that may still store results, also deleted Jobs with pods."""
    jobs = (snapshot.job(shard) for shard in snapshot.shards)
    return [job for job in jobs if job is not None and job.open]


def _tidy(snapshot: Snapshot) -> list[Action]:
    """Delete Jobs whose verdicts are in the status, except for the last few, and what is past."""
    jobs = (snapshot.job(shard) for shard in snapshot.shards if snapshot.is_remembered(shard))
    finished = [job for job in jobs if job is not None and not job.open]
    past = [*snapshot.finish.old, *snapshot.search.past_jobs, *snapshot.replaced]
    old = [*finished[:-WINDOW], *past]
    plans = [DeletePlan(name) for name in snapshot.past_plans]
    return [*plans, *(DeleteJob(job.name) for job in old if not job.deleting)]


def _withdraw(snapshot: Snapshot) -> list[Action]:
    """Delete the Jobs of Configurations that were deleted: nothing else does.

    The Campaign is their owner, so that they go with that, whether the operator is there or not.
    An object goes when its last owner does, so the Configuration cannot be another one; nor can it
    belong to the Campaign: GitOps tools do not prune what has an owner.
    """
    withdrawn = snapshot.withdrawn
    gone = (job for job in snapshot.jobs.values() if job.configuration in withdrawn)
    return [DeleteJob(job.name) for job in gone if not job.deleting]


def _expiry(snapshot: Snapshot) -> datetime | None:
    """Return when to delete the Jobs of a finished campaign."""
    ttl = snapshot.accepted.spec.ttl_seconds_after_finished
    ended = snapshot.status.completion_time
    if ttl is None or ended is None or not snapshot.indexed:
        return None
    return parse_time(ended) + timedelta(seconds=ttl)


def _expire(snapshot: Snapshot) -> list[Action]:
    expiry = _expiry(snapshot)
    if expiry is None or snapshot.now < expiry:
        return []
    return [DeleteJob(job.name) for job in snapshot.jobs.values() if not job.deleting]


def _again(snapshot: Snapshot) -> float | None:
    expiry = _expiry(snapshot)
    if expiry is None or not snapshot.jobs:
        return _pause(snapshot)
    return max(1.0, (expiry - snapshot.now).total_seconds())
