"""Events about a campaign's progress, in addition to conditions: few, for any number of runs.

Pure functions. Each Event follows from the change of the status that it is written with, so it
is there once, even after a crash in between. `kubectl describe campaign` shows them in order.
"""

from __future__ import annotations

from collections.abc import Iterator

from robovast.kubeapi.status import CampaignStatus
from robovast_operator.kube.events import EventContent
from robovast_operator.pods.observations import MISHAPS
from robovast_operator.snapshot import Snapshot


def progress_events(snapshot: Snapshot, new: CampaignStatus) -> Iterator[EventContent]:
    """Generate Events for the change of a campaign's status to a new one."""
    yield from _planned(snapshot, new)
    yield from _jobs(snapshot, new)
    yield from _repeated(snapshot, new)
    yield from _mishaps(snapshot, new)


def _planned(snapshot: Snapshot, new: CampaignStatus) -> Iterator[EventContent]:
    """Generate the Event of the first runs, and of runs that a change of the Campaign adds."""
    old, total = snapshot.status, new.runs.total
    asked = not old.runs.total or old.observed_generation != new.observed_generation
    if total <= old.runs.total or not asked:
        return
    packs, most = snapshot.plan.packs, snapshot.accepted.spec.parallelism
    message = (
        f"The campaign has {_count(total, 'run')} in {_count(packs, 'job')}, and uses at most "
        f"{_count(most, 'pod')} concurrently."
    )
    yield EventContent("Normal", "Planned", message, str(total))


def _jobs(snapshot: Snapshot, new: CampaignStatus) -> Iterator[EventContent]:
    """Generate the first Job, the tenth, the hundredth, and so on."""
    before, now = _created_shards(snapshot.status), _created_shards(new)
    if now <= before or _step(before) == _step(now):
        return
    job = new.shards[-1].job if new.shards else ""
    number = f" The campaign has {now} Jobs." if now > 1 else ""
    message = f"The operator created the Job {job}.{number}"
    yield EventContent("Normal", "JobCreated", message, f"{new.attempt} {_step(now)}")


def _created_shards(status: CampaignStatus) -> int:
    return status.settled.shards + len(status.shards)


def _repeated(snapshot: Snapshot, new: CampaignStatus) -> Iterator[EventContent]:
    """Generate another attempt."""
    if new.bad is not None and new.attempt > snapshot.status.attempt:
        message = f"Attempt {new.attempt} repeats {_count(new.bad.runs, 'unsuccessful run')}."
        yield EventContent("Normal", "RetryStarted", message, str(new.attempt))


def _mishaps(snapshot: Snapshot, new: CampaignStatus) -> Iterator[EventContent]:
    """Generate Events of the first mishaps, then of the tenth, the hundredth, and so on."""
    before, now = _bad(snapshot.status), _bad(new)
    # A Job counts its unsuccessful runs before the operator reads the reports of their pods.
    if _is_among_first(before, now) or _is_among_first(_reported(snapshot.status), _reported(new)):
        for one in snapshot.pods.mishaps:
            yield EventContent("Warning", one.reason, one.message, f"{new.attempt} {one.about}")
    if _step(before) < _step(now) and now >= 10:
        runs = new.runs
        message = (
            f"{runs.failed} runs failed and {runs.errored} runs errored, of {runs.decided} "
            "finished runs. List the unsuccessful runs with `vast exec cluster runs --failed`."
        )
        yield EventContent("Warning", "RunsUnsuccessful", message, f"{new.attempt} {_step(now)}")


def _bad(status: CampaignStatus) -> int:
    """Return how many runs did not pass, or may not have."""
    return status.runs.failed + status.runs.errored + status.runs.undecided


def _reported(status: CampaignStatus) -> int:
    """Return the number of unsuccessful runs that pods have reported."""
    return status.runs.failed + status.runs.errored


def _is_among_first(before: int, now: int) -> bool:
    return before < min(now, MISHAPS)


def _step(number: int) -> int:
    """Return the number of digits of a positive number, and 0 for 0."""
    return len(str(number)) if number else 0


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
