"""What is told of a campaign: its status, from its picture. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from robovast.cluster.ranges import Span, count, format_ranges, merge, subtract, truncate
from robovast.cluster.status import RANGES_LIMIT, CampaignStatus, Runs, Shard
from robovast_operator.conditions import Facts, Why, campaign_conditions, campaign_state
from robovast_operator.picture import Picture, Trouble
from robovast_operator.shards import ShardPlan, run_ids
from robovast_operator.store import JobState
from robovast_operator.times import format_time


def tell(picture: Picture, created: Sequence[ShardPlan]) -> CampaignStatus:
    """The status of a campaign, with the shards that are just being made."""
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
        attempt=_attempt(picture, records),
        runs=runs,
        failed_runs=failed,
        errored_runs=errored,
        ranges_truncated=truncated,
        failing=list(failing),
        shards=records,
        finished_shards=picture.ended_shards if indexed else old.finished_shards,
        queue=picture.held and picture.held.place,
        start_time=started,
        completion_time=(old.completion_time or ended) if ended else None,
        notified=old.notified,
    )
    facts = _facts(picture, runs, active=bool(picture.open or created))
    conditions = campaign_conditions(facts, old.conditions)
    return status.model_copy(
        update={"conditions": conditions, "state": campaign_state(facts, conditions)}
    )


def _attempt(picture: Picture, records: Sequence[Shard]) -> int:
    """The attempt that is at work, or done."""
    known = max([picture.observed.status.attempt, *(record.attempt for record in records)])
    nothing_bad = picture.repetition_due and picture.all_ended
    return max(known, picture.observed.accepted.spec.attempt) if nothing_bad else known


def _facts(picture: Picture, runs: Runs, *, active: bool) -> Facts:
    observed, held = picture.observed, picture.held
    return Facts(
        generation=observed.generation,
        now=format_time(observed.now),
        spec=observed.accepted.spec,
        runs=runs,
        active=active,
        over=picture.over,
        indexed=picture.indexed,
        aborted=_why(picture.aborted),
        trouble=_why(observed.trouble),
        quota=None if held is None else (held.reason, held.message),
        helpless=held is not None and held.helpless,
        unprocessed=_why(observed.failures.get(picture.process_name)),
    )


def _why(trouble: Trouble | None) -> Why | None:
    return None if trouble is None else (trouble.reason, trouble.message)


def _records(picture: Picture, created: Sequence[ShardPlan]) -> list[Shard]:
    """Shards that the status remembers: they have a Job, had one, or repeat bad runs."""
    made = {shard.job for shard in created}
    records = []
    for shard in picture.shards:
        record, job = picture.records.get(shard.job), picture.job(shard)
        known = record is not None or job is not None or shard.job in made or shard.attempt > 1
        if not known and not picture.withdrawn(shard):
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
    picture: Picture, shard: ShardPlan, record: Shard | None, job: JobState | None, made: bool
) -> Literal["Waiting", "Open", "Complete", "Failed"]:
    if record is not None and record.state in {"Complete", "Failed"}:
        return record.state
    if job is not None and not job.open:
        good = job.finished == "Complete" or job.reason == "FailedIndexes"
        return "Complete" if good else "Failed"
    given_up = picture.aborted is not None and (job is not None or record is not None)
    if given_up or picture.withdrawn(shard):
        return "Failed"
    return "Open" if job is not None or made or shard.attempt == 1 else "Waiting"


def _numbers(picture: Picture) -> tuple[Runs, str, str, bool, Sequence[str]]:
    """Counts and bad runs: as the Jobs say, and in the end as the bucket says."""
    observed, verdicts = picture.observed, picture.verdicts
    final = picture.final
    if final is not None and picture.over:
        return final.runs, final.failed, final.errored, final.truncated, final.failing
    old = observed.status
    if picture.indexed and old.finished_shards == picture.ended_shards:
        return old.runs, old.failed_runs, old.errored_runs, old.ranges_truncated, old.failing
    errored = merge([*verdicts.errored, *_cancelled(picture)])
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


def _cancelled(picture: Picture) -> list[Span]:
    """Runs that were given up: under way when the campaign was, or asked for by nobody any more."""
    aborted = picture.aborted is not None
    given_up = [
        shard
        for shard in picture.shards
        if picture.withdrawn(shard) or (aborted and picture.job(shard) is not None)
    ]
    ids = [s for shard in given_up for s in run_ids(picture.plan, shard, [(0, shard.size - 1)])]
    return subtract(ids, picture.verdicts.decided)
