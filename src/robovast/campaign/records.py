"""Makes the record of a finished run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import TestResult
from robovast.model.plan import PackStart, Run


@dataclass(frozen=True)
class EndedRun:
    """A run that is over, out of its job's reach."""

    job: PackStart
    run: Run
    folder: Path
    """What it wrote; need not exist."""
    result: TestResult
    observed: tuple[float, float]
    """When it was seen to start and to end [s since the epoch]."""
    exit_code: int | None
    """Of its process; None when that goes on with other runs."""


@dataclass(frozen=True)
class Circumstances:
    """The part of a run's record that describes the execution, not the run or its result."""

    campaign: str
    attempt: int
    job: str
    runtime: str
    image: str
    image_digest: str
    host: str
    pod: str = ""
    """The pod that executed the run, on a cluster."""
    key: str = ""
    """What the run depended on, as a hash."""
    outputs: dict[str, str] | None = None
    """SHA-256 of what it wrote, by path."""


def make_record(ended: EndedRun, circumstances: Circumstances) -> RunRecord:
    """The record of a run."""
    run, result, observed = ended.run, ended.result, ended.observed
    started = result.started_at or observed[0]
    duration = result.duration if result.duration is not None else observed[1] - observed[0]
    return RunRecord(
        variant=run.variant.name,
        entry=run.variant.entry,
        run=run.number,
        id=run.id,
        verdict=result.verdict,
        reason=result.reason,
        started_at=_iso(started),
        finished_at=_iso(started + duration),
        duration=round(duration, 6),
        exit_code=ended.exit_code,
        seed=run.seed,
        parameters=dict(run.variant.parameters),
        factors=dict(run.variant.factors),
        **asdict(circumstances),
    )


def copied_record(origin: RunRecord, executed: str, run: Run, campaign: str, job: str) -> RunRecord:
    """The record of a run that is a copy of another campaign's; its files are not stored yet.

    Args:
        origin: record of the run that is copied.
        executed: `<campaign>/<variant>/<run>` of that.
        run: the run that need not be executed.
        campaign: of the run.
        job: the job that would have executed it.
    """
    return replace(
        origin,
        campaign=campaign,
        variant=run.variant.name,
        entry=run.variant.entry,
        run=run.number,
        id=run.id,
        job=job,
        seed=run.seed,
        parameters=dict(run.variant.parameters),
        factors=dict(run.variant.factors),
        reused_from=origin.reused_from or executed,
        files=None,
    )


def _iso(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
