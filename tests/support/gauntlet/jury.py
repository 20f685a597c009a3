"""Gathering what is left of campaigns, and comparing it with the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from support.gauntlet.entrants import Entrant
from support.gauntlet.executions import read_traces
from support.gauntlet.faults import Arena
from support.gauntlet.verdict import (
    Begun,
    Fault,
    Kept,
    Violation,
    compare_readers,
    compare_runs,
    compare_status,
    missing_runs,
    read_results,
    repeated,
)
from support.gauntlet.watch import Watch


def judge(entrant: Entrant, where: Arena, home: Path) -> Iterator[Violation]:
    """Compare all that is left of a campaign with the truth."""
    course, excuses = entrant.course, where.excuses
    bucket = where.storage / "buckets" / (entrant.bucket or "none")
    if entrant.deleted and entrant.retention == "Delete":
        if entrant.bucket and bucket.exists():
            yield Violation(Fault.MISJUDGED, course.salt, "its bucket is still there")
        return
    kept = read_results(bucket)
    attempt_of = entrant.attempt_of if entrant.finished else None
    yield from compare_runs(course, kept, excuses, attempt_of)
    if entrant.finished or not entrant.deleted:
        yield from missing_runs(course, kept)
    if entrant.deleted:
        return
    if not entrant.finished:
        yield Violation(Fault.MISJUDGED, course.salt, f"it never ended: {_told(entrant)}")
        return
    yield from compare_status(course, entrant.status, kept)
    yield from compare_download(entrant, kept, home)


def _told(entrant: Entrant) -> str:
    conditions = {c["type"]: c for c in entrant.status.get("conditions", [])}
    stalled = conditions.get("Stalled", {})
    return (
        f"{entrant.status.get('state')} {entrant.status.get('progress')}, "
        f"stalled: {stalled.get('status')} {stalled.get('reason')} {stalled.get('message')}"
    )


def compare_download(entrant: Entrant, kept: Kept, home: Path) -> Iterator[Violation]:
    target = home / entrant.course.salt
    words = ("results", "download", "-n", entrant.lab.namespace, "-i", entrant.name, "-o", target)
    done = entrant.lab.vast(*words, code=None)
    if done.returncode != 0:
        text = " ".join((done.stdout + done.stderr).split())[-400:]
        yield Violation(Fault.LOST, entrant.course.salt, f"it cannot be downloaded: {text}")
        return
    mine = read_results(target / str(entrant.status["campaign"]))
    yield from compare_readers(entrant.course, kept, mine)


def executions(
    entrants: Sequence[Entrant], watch: Watch, trace: Path
) -> tuple[int, list[Violation]]:
    """How many executions there were, and which must not have been."""
    begun: dict[str, list[Begun]] = {}
    for seconds, line in read_traces(trace):
        if line.event == "begin":
            begun.setdefault(line.salt, []).append(Begun(seconds, line.run, line.execution))
    found: list[Violation] = []
    for entrant in entrants:
        stored = watch.stored.get(entrant.bucket or "", [])
        salt = entrant.course.salt
        found += repeated(salt, begun.get(salt, ()), stored, entrant.retries)
    return sum(map(len, begun.values())), found
