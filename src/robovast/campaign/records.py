"""Making the record of a run that has ended."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import TestResult
from robovast.model.plan import Run


@dataclass(frozen=True)
class Circumstances:
    """What a run's record says beside the run and its result."""

    campaign: str
    attempt: int
    job: str
    runtime: str
    image: str
    image_digest: str
    host: str
    pod: str = ""
    """On a cluster: which pod executed it."""


def make_record(
    run: Run,
    result: TestResult,
    observed: tuple[float, float],
    exit_code: int | None,
    circumstances: Circumstances,
) -> RunRecord:
    """The record of a run.

    Args:
        run: the run.
        result: its verdict.
        observed: when it was seen to start and to end [s since the epoch].
        exit_code: of its process, None when that goes on with other runs.
        circumstances: all else.
    """
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
        exit_code=exit_code,
        parameters=dict(run.variant.parameters),
        **asdict(circumstances),
    )


def _iso(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
