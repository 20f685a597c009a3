"""Comparing what is left of campaigns with the truth: pure functions of what was seen."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from robovast.base.ranges import parse_ranges
from robovast.campaign.verdict import Verdict
from support.gauntlet.truth import RECORD, Course, look_at_files


class Fault(StrEnum):
    """What must never be."""

    LOST = "lost"
    """A run, or a file of one, is not there."""
    REPEATED = "executed twice after being stored"
    MISJUDGED = "misjudged"
    """A verdict, a number or a condition is not right."""
    MIXED = "mixed"
    """Files are of several executions, or of another run."""
    """More pods at a time than a namespace may have."""


@dataclass(frozen=True)
class Violation:
    """One thing that must not be."""

    fault: Fault
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.fault}: {self.where}: {self.text}"


JUMP = 3600
"""How far clocks jump; runs take, and wait to be stored, for less than half of it [s]."""


@dataclass(frozen=True)
class Excuse:
    """When something was done to runs themselves, so that they could not end as they should."""

    begin: float
    """[s since the epoch]"""
    end: float
    salt: str = ""
    """The campaign that it was done to; empty: all of them."""
    runs: int | None = None
    """How many runs it may have changed; None: any number."""

    def covers(self, salt: str, record: Mapping[str, Any], stored: float) -> bool:
        """Say whether a run was executed meanwhile.

        Args:
            salt: its campaign.
            record: what is stored of it.
            stored: when that was [s since the epoch]; the clock that its times are by may have been
                wrong by an hour.
        """
        if self.salt not in ("", salt):
            return False
        begin, end = (_seconds(record[key]) for key in ("started_at", "finished_at"))
        wrong = round((end - stored) / JUMP) * JUMP
        return begin - wrong <= self.end and end - wrong >= self.begin


@dataclass(frozen=True)
class Kept:
    """A campaign's results, as one reader finds them."""

    records: dict[str, dict[str, Any]]
    files: dict[str, dict[str, bytes]]
    """Content by path, by run."""
    stored: dict[str, float]
    """When each record was written, by run [s since the epoch]."""


def read_results(folder: Path) -> Kept:
    """The runs of a campaign that have a record, and their files.

    Args:
        folder: the results, or the bucket as the S3 server keeps it: there a record names a list
            of the run's files, each with its key, unless an older version has stored it.
    """
    kept = Kept({}, {}, {})
    for path in sorted(folder.glob("*/*/" + RECORD)):
        run = path.parent.relative_to(folder).as_posix()
        record = kept.records[run] = json.loads(path.read_bytes())
        kept.stored[run] = path.stat().st_mtime
        listed = path.parent / (record.get("files") or {}).get("key", RECORD)
        is_list = listed.name != RECORD and listed.exists()
        kept.files[run] = dict(_listed(listed) if is_list else _contents(path.parent))
    return kept


def _listed(path: Path) -> Iterator[tuple[str, bytes]]:
    for item in json.loads(path.read_bytes())["files"]:
        place = path.parent / item["key"]
        if place.exists():
            yield item["path"], place.read_bytes()


def _contents(folder: Path) -> Iterator[tuple[str, bytes]]:
    for parent, _, names in os.walk(folder):
        for name in names:
            path = Path(parent, name)
            if not path.is_symlink() and name != RECORD:
                yield path.relative_to(folder).as_posix(), path.read_bytes()


def compare_runs(
    course: Course,
    kept: Kept,
    excuses: Sequence[Excuse],
    attempt_of: Callable[[str], int] | None,
) -> list[Violation]:
    """Compare every run's record and files with the truth.

    Args:
        course: the campaign, with as many runs as it was asked for.
        kept: its results.
        excuses: what was done to runs.
        attempt_of: in which attempt a run was executed last, if it is bad; None when that did not
            come to its end.
    """
    truth = course.truth()
    found = []
    left = [excuse.runs for excuse in excuses]
    for run, record in kept.records.items():
        if run not in truth:
            found.append(Violation(Fault.MISJUDGED, f"{course.salt} {run}", "there is no such run"))
            continue
        faults = list(_compare_run(course, run, kept, attempt_of))
        if not any(fault.fault is not Fault.MIXED for fault in faults):
            found += faults
            continue
        covering = (
            i
            for i, e in enumerate(excuses)
            if left[i] != 0 and e.covers(course.salt, record, kept.stored[run])
        )
        index = next(covering, None)
        if index is None:
            found += faults
        else:
            count = left[index]
            left[index] = None if count is None else count - 1
            found += [fault for fault in faults if fault.fault is Fault.MIXED]
    return found


def _compare_run(
    course: Course, run: str, kept: Kept, attempt_of: Callable[[str], int] | None
) -> Iterator[Violation]:
    where = f"{course.salt} {run} ({course.kind(run)})"
    record, right = kept.records[run], course.truth()[run]
    if record["verdict"] != right:
        text = f"{record['verdict']} ({record['reason']}), {right} is right"
        yield Violation(Fault.MISJUDGED, where, text)
    elif attempt_of and right is not Verdict.PASSED and record["attempt"] != attempt_of(run):
        text = f"attempt {record['attempt']} of {attempt_of(run)}, it was bad"
        yield Violation(Fault.MISJUDGED, where, text)
    seen = look_at_files(course, run, kept.files[run])
    for text in seen.missing:
        yield Violation(Fault.LOST, where, text)
    for text in seen.foreign:
        yield Violation(Fault.MIXED, where, text)
    if len(seen.executions) > 1:
        yield Violation(Fault.MIXED, where, f"files of {len(seen.executions)} executions")


def missing_runs(course: Course, kept: Kept) -> list[Violation]:
    """The runs that are not there."""
    return [
        Violation(Fault.LOST, f"{course.salt} {run}", "it is not stored")
        for run in course.truth()
        if run not in kept.records
    ]


def compare_status(course: Course, status: Mapping[str, Any], kept: Kept) -> list[Violation]:
    """Compare what a finished Campaign says with the records of its runs."""
    verdicts = Counter(record["verdict"] for record in kept.records.values())
    total = len(course.truth())
    right: dict[str, Any] = {
        "runs.total": total,
        "runs.stored": total,
        "runs.active": 0,
        **{f"runs.{verdict}": verdicts[verdict] for verdict in ("passed", "failed", "errored")},
        "failedRuns": _ids(kept, Verdict.FAILED),
        "erroredRuns": _ids(kept, Verdict.ERRORED),
        "Succeeded": "True",
        "Passed": "True" if verdicts[Verdict.PASSED] == total else "False",
        "ResultsAvailable": "True",
    }
    conditions = {item["type"]: item["status"] for item in status.get("conditions", [])}
    said: dict[str, Any] = {
        **{f"runs.{name}": count for name, count in status.get("runs", {}).items()},
        **{name: _said_ids(status.get(name)) for name in ("failedRuns", "erroredRuns")},
        **conditions,
    }
    return [
        Violation(Fault.MISJUDGED, course.salt, f"{name} is {said.get(name, 0)!r}, not {value!r}")
        for name, value in right.items()
        if said.get(name, 0) != value
    ]


def _ids(kept: Kept, verdict: Verdict) -> set[int]:
    return {record["id"] for record in kept.records.values() if record["verdict"] == verdict}


def _said_ids(ranges: str | None) -> set[int]:
    return {id_ for first, last in parse_ranges(ranges or "") for id_ in range(first, last + 1)}


def compare_readers(course: Course, first: Kept, second: Kept) -> list[Violation]:
    """Compare what two readers find: the same executions of the same runs."""
    return [
        Violation(Fault.MIXED, f"{course.salt} {run}", "download and bucket differ")
        for run in sorted({*first.records, *second.records})
        if _of_run(first, run) != _of_run(second, run)
    ]


def _of_run(kept: Kept, run: str) -> object:
    return kept.records.get(run), kept.files.get(run)


@dataclass(frozen=True)
class Stored:
    """A run's record was seen for the first time."""

    seconds: float
    """[s since the epoch]"""
    run: str
    attempt: int
    verdict: str


@dataclass(frozen=True)
class Begun:
    """An execution of a run began."""

    seconds: float
    run: str
    execution: str


def repeated(
    salt: str, begun: Iterable[Begun], stored: Iterable[Stored], retries: Sequence[float]
) -> list[Violation]:
    """Executions that began although the run had been stored.

    Args:
        salt: the campaign.
        begun: its executions.
        stored: its records, each when it had surely been there.
        retries: when its bad runs were asked for again [s since the epoch].
    """
    by_run: dict[str, list[Stored]] = {}
    for item in stored:
        by_run.setdefault(item.run, []).append(item)
    found = []
    for start in begun:
        before = [item for item in by_run.get(start.run, ()) if item.seconds < start.seconds]
        if not before:
            continue
        last = max(before, key=lambda item: item.attempt)
        asked = 1 + sum(moment < start.seconds for moment in retries)
        if last.attempt >= asked or last.verdict == Verdict.PASSED:
            text = (
                f"execution {start.execution} began {start.seconds - last.seconds:.1f} s after "
                f"attempt {last.attempt} ({last.verdict}) was stored"
            )
            found.append(Violation(Fault.REPEATED, f"{salt} {start.run}", text))
    return found


def _seconds(moment: str) -> float:
    return datetime.fromisoformat(moment).timestamp()
