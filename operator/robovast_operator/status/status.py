"""The status of a campaign, made from its snapshot. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Literal

from robovast.base.ranges import Span, count, format_ranges, merge, parse_ranges, truncate
from robovast.kubeapi.status import RANGES_LIMIT, SHARDS_LIMIT, CampaignStatus, Runs, Settled, Shard
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time
from robovast_operator.planning.shards import ShardPlan
from robovast_operator.pods.verdicts import Tally
from robovast_operator.snapshot import Snapshot
from robovast_operator.status.conditions import campaign_conditions, campaign_state
from robovast_operator.status.estimate import estimate_of


def campaign_status(snapshot: Snapshot, created: Sequence[ShardPlan]) -> CampaignStatus:
    """Return the status of a campaign, including the shards that are just being created."""
    old = snapshot.status
    accepted = snapshot.accepted
    records, settled = _folded(snapshot, _records(snapshot, created))
    numbers = _numbers(snapshot)
    runs, indexed = numbers.runs, snapshot.indexed
    started = old.start_time or (format_time(snapshot.now) if _begins(snapshot, created) else None)
    ended = format_time(snapshot.now) if snapshot.over else None
    status = CampaignStatus(
        observed_generation=snapshot.generation,
        progress=f"{runs.decided}/{runs.needed}",
        campaign=accepted.campaign,
        bucket=accepted.bucket,
        endpoint=accepted.endpoint,
        image=accepted.image,
        attempt=snapshot.attempt,
        runs_per_configuration=accepted.runs,
        runs=runs,
        failed_runs=numbers.failed,
        errored_runs=numbers.errored,
        ranges_truncated=numbers.truncated,
        failing=list(numbers.failing),
        shards=records,
        finished_shards=snapshot.ended_shards if indexed else old.finished_shards,
        settled=settled,
        bad=snapshot.bad,
        search=snapshot.search.status,
        decisions=snapshot.decisions,
        queue=snapshot.held and snapshot.held.place,
        estimate=estimate_of(snapshot, runs),
        start_time=started,
        completion_time=(old.completion_time or ended) if ended else None,
        shared=(snapshot.results if accepted.spec.share else "") or old.shared,
        notified=old.notified,
    )
    conditions = campaign_conditions(snapshot, runs)
    active = bool(snapshot.open or created)
    state = campaign_state(snapshot, runs, conditions, active=active)
    return status.model_copy(update={"conditions": conditions, "state": state})


def _begins(snapshot: Snapshot, created: Sequence[ShardPlan]) -> bool:
    """Return whether a shard is started; a shard that a queue holds back is not started."""
    jobs = [snapshot.job(shard) for shard in snapshot.shards]
    if any(job is not None and not job.suspended for job in jobs):
        return True
    return bool(created) and snapshot.accepted.spec.queue_name is None


def _records(snapshot: Snapshot, created: Sequence[ShardPlan]) -> list[Shard]:
    """Return the records of shards that have or had a Job."""
    made = {shard.job for shard in created}
    records = []
    for shard in snapshot.shards:
        record, job = snapshot.records.get(shard.job), snapshot.job(shard)
        exists = record is not None or job is not None or shard.job in made
        if not exists and not snapshot.is_withdrawn(shard):
            continue
        ended = snapshot.ended(shard)
        tally = snapshot.tallies[shard.job] if ended else Tally()
        records.append(
            Shard(
                index=shard.index,
                job=shard.job,
                state=_record_state(snapshot, shard, record, job),
                packs=shard.packs,
                attempt=shard.attempt,
                passed=tally.passed,
                failed=tally.failed,
                errored=tally.errored,
                not_needed=tally.not_needed,
                configuration=shard.configuration,
                plan=shard.plan,
            )
        )
    return records


def _folded(snapshot: Snapshot, records: Sequence[Shard]) -> tuple[list[Shard], Settled]:
    """Return the shards for the status; count only the oldest if there are too many."""
    current = {shard.job for shard in snapshot.shards}
    past = [record for record in snapshot.status.shards if record.job not in current]
    settled = snapshot.settled
    if settled != snapshot.status.settled:  # all of them are settled now
        return [*past, *records][-SHARDS_LIMIT:], settled
    by_job = {record.job: record for record in records}
    folded: list[Shard] = []
    for repeated in (False, True):
        mine = [by_job.get(s.job) for s in snapshot.shards if bool(s.repeat) == repeated]
        folded += [record for record in takewhile(_has_ended, mine) if record is not None]
    folded = folded[: max(0, len(records) - SHARDS_LIMIT)]
    update = {
        "shards": settled.shards + len(folded),
        "first": settled.first + sum(record.attempt == 1 for record in folded),
        "repeated": settled.repeated + sum(record.attempt > 1 for record in folded),
        **{
            kind: getattr(settled, kind) + sum(getattr(record, kind) for record in folded)
            for kind in ("passed", "failed", "errored", "not_needed")
        },
    }
    rest = [record for record in records if record not in folded]
    return [*past, *folded, *rest][-SHARDS_LIMIT:], settled.model_copy(update=update)


def _has_ended(record: Shard | None) -> bool:
    return record is not None and record.state in {"Complete", "Failed"}


def _record_state(
    snapshot: Snapshot, shard: ShardPlan, record: Shard | None, job: JobState | None
) -> Literal["Waiting", "Open", "Complete", "Failed"]:
    if record is not None and record.state in {"Complete", "Failed"}:
        return record.state
    if job is not None and not job.open:
        good = job.finished == "Complete" or job.reason == "FailedIndexes"
        return "Complete" if good else "Failed"
    given_up = snapshot.aborted is not None and (job is not None or record is not None)
    return "Failed" if given_up or snapshot.is_withdrawn(shard) else "Open"


@dataclass(frozen=True)
class _Numbers:
    """Counts, and as many bad runs as the status lists."""

    runs: Runs
    failed: str = ""
    errored: str = ""
    truncated: bool = False
    failing: Sequence[str] = ()


def _numbers(snapshot: Snapshot) -> _Numbers:
    """Return counts and unsuccessful runs: first from the Jobs, at the end from the bucket."""
    old, final, settled = snapshot.status, snapshot.final, snapshot.settled
    if snapshot.repeats:
        return _Numbers(Runs(total=snapshot.plan.total, **_counts(settled), stored=settled.passed))
    if final is not None:
        failed, errored, cut = _texts(final.failed, final.errored)
        return _Numbers(final.runs, failed, errored, final.truncated or cut, final.failing)
    if snapshot.indexed:
        return _Numbers(
            old.runs, old.failed_runs, old.errored_runs, old.ranges_truncated, old.failing
        )
    tally = snapshot.tally
    runs = Runs(
        total=snapshot.plan.total,
        active=sum(job.at_work for job in snapshot.open),
        waiting=sum(job.pods - job.at_work for job in snapshot.open),
        **_counts(tally),
        stored=tally.passed + tally.failed,
        undecided=snapshot.undecided,
    )
    failed, errored, cut = _texts(
        merge([*parse_ranges(old.failed_runs), *tally.failed_ids]),
        merge([*parse_ranges(old.errored_runs), *tally.errored_ids]),
    )
    listed = sum(count(parse_ranges(text)) for text in (failed, errored))
    return _Numbers(runs, failed, errored, cut or listed < tally.failed + tally.errored)


def _counts(of: Tally | Settled) -> dict[str, int]:
    kinds = ("passed", "failed", "errored", "not_needed")
    return {kind: getattr(of, kind) for kind in kinds}


def _texts(failed: Sequence[Span], errored: Sequence[Span]) -> tuple[str, str, bool]:
    """Return as many ids as fit into the status, and whether ids are missing."""
    cut = [truncate(format_ranges(ids), RANGES_LIMIT) for ids in (failed, errored)]
    return cut[0][0], cut[1][0], any(was_cut for _, was_cut in cut)
