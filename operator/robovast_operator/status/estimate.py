"""When a campaign ends, by its own pace so far. Pure functions."""

from __future__ import annotations

from datetime import timedelta

from robovast.kubeapi.status import Estimate, Runs
from robovast.model.estimate import cores_of, remaining
from robovast_operator.kube.times import format_time, parse_time
from robovast_operator.snapshot import Snapshot

FOR_EVER = 1e9
"""What nobody waits for [s]."""


def estimate_of(snapshot: Snapshot, runs: Runs) -> Estimate | None:
    """When a campaign ends; None before its first run has ended, and where nobody can know.

    It is made anew only when further runs have ended: it causes no write of its own.

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
    found = remaining(done, max(0, runs.needed - done), spec.parallelism, spent)
    if found is None or found.most > FOR_EVER:
        return None
    cores = cores_of(snapshot.accepted.vast.execution, spec.cluster or "")
    hours = cores * min(spec.parallelism, runs.needed) * (spent + found.seconds) / 3600
    return Estimate(
        end=_after(snapshot, found.seconds),
        earliest=_after(snapshot, found.least),
        latest=_after(snapshot, found.most),
        cpu_hours=round(hours, 3) if cores else None,
    )


def _after(snapshot: Snapshot, seconds: float) -> str:
    return format_time(snapshot.now + timedelta(seconds=seconds))
