"""When a campaign ends, by its own pace so far. Pure functions."""

from __future__ import annotations

from datetime import timedelta

from robovast.kubeapi.status import Estimate, Runs
from robovast.model.estimate import CampaignProgress, cores_of, remaining
from robovast_operator.kube.times import format_time, parse_time
from robovast_operator.snapshot import Snapshot

FOR_EVER = 1e9
"""Longer estimates are not reported [s]."""


def estimate_of(snapshot: Snapshot, runs: Runs) -> Estimate | None:
    """Estimate when a campaign ends; None before the first run has finished, or if unknown.

    The estimate changes only when further runs have finished, so it causes no extra write.

    Args:
        snapshot: of the campaign.
        runs: its numbers now.
    """
    old, spec = snapshot.status, snapshot.accepted.spec
    waits = spec.suspend or snapshot.held is not None or old.start_time is None
    if waits or snapshot.quiet or snapshot.attempt > 1 or snapshot.accepted.is_search:
        return None
    done = runs.decided + runs.undecided
    if old.estimate is not None and done == old.runs.decided + old.runs.undecided:
        return old.estimate
    spent = (snapshot.now - parse_time(str(old.start_time))).total_seconds()
    found = remaining(_progress(snapshot, done, max(0, runs.needed - done), spent))
    if found is None or found.most > FOR_EVER:
        return None
    cores = cores_of(snapshot.accepted.vast.execution, spec.cluster or "")
    pods = min(spec.parallelism, max(1, snapshot.plan.packs))
    hours = cores * pods * (spent + found.seconds) / 3600
    return Estimate(
        end=_after(snapshot, found.seconds),
        earliest=_after(snapshot, found.least),
        latest=_after(snapshot, found.most),
        cpu_hours=round(hours, 3) if cores else None,
    )


def _progress(snapshot: Snapshot, done: int, left: int, seconds: float) -> CampaignProgress:
    """Return the progress of a campaign with its current number of pods."""
    plan, parallelism = snapshot.plan, snapshot.accepted.spec.parallelism
    rounds, pace = plan.rounds, snapshot.pods.pace
    size = rounds[-1].size if rounds else (done + left) / max(1, plan.packs)
    active = sum(min(job.active, job.left) for job in snapshot.open)
    begun = min(float(left), active * size)
    few = begun < left  # else pods are few because packs are
    workers = max(1, min(active, parallelism)) if few else parallelism
    if not rounds or pace is None:
        return CampaignProgress(done, left, begun, workers, seconds, max(1.0, size))
    starts = min(pace.start * plan.packs / workers, seconds - pace.run * done / workers)
    return CampaignProgress(done, left, begun, workers, seconds, starts=max(0.0, starts))


def _after(snapshot: Snapshot, seconds: float) -> str:
    return format_time(snapshot.now + timedelta(seconds=seconds))
