"""A gauntlet that cannot fail proves nothing: each fault is told, and what was done is excused."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from support.gauntlet.truth import LINES, Course, Kind
from support.gauntlet.verdict import (
    Begun,
    Excuse,
    Fault,
    Kept,
    Stored,
    compare_readers,
    compare_runs,
    compare_status,
    missing_runs,
    read_results,
    repeated,
)

COURSE = Course("salt", "cat", variants=2, runs=1, kinds=[Kind.PASS] * 5 + [Kind.FAIL] * 12)
"""Variant 1 fails, variant 2, too; so does every run that a test does not change."""
START, END = "2026-01-01T00:00:00+00:00", "2026-01-01T00:00:10+00:00"
MIDDLE = 1767225605.0


def kept(course: Course = COURSE) -> Kept:
    """Results as they must be."""
    records, files = {}, {}
    for id_, (run, verdict) in enumerate(course.truth().items()):
        records[run] = {
            "verdict": verdict.value, "attempt": 1, "reason": "", "id": id_,
            "started_at": START, "finished_at": END,
        }  # fmt: skip
        files[run] = {
            name.decode(): f"salt {run} {index} e{id_}\n".encode() * LINES
            for index, name in enumerate(course.names(run))
        }
    return Kept(records, files, dict.fromkeys(records, MIDDLE + 7))


def faults(found: Kept, *excuses: Excuse, attempts: int = 1) -> list[Fault]:
    return [item.fault for item in compare_runs(COURSE, found, excuses, lambda _: attempts)]


def test_right_results_have_no_fault() -> None:
    assert faults(kept()) == []
    assert missing_runs(COURSE, kept()) == []
    assert compare_readers(COURSE, kept(), kept()) == []


def test_a_wrong_verdict_a_lost_file_and_a_mixture_are_told_apart() -> None:
    found = kept()
    found.records["one-1/0"]["verdict"] = "passed"
    assert faults(found) == [Fault.MISJUDGED]
    found = kept()
    del found.files["one-1/0"]["last.txt"]
    assert faults(found) == [Fault.LOST]
    found = kept()
    found.files["one-1/0"]["last.txt"] = found.files["one-1/0"]["last.txt"].replace(b" e0", b" e9")
    assert faults(found) == [Fault.MIXED]
    found = kept()
    found.files["one-1/0"]["more"] = b"somebody else's\n"
    assert faults(found) == [Fault.MIXED]


def test_a_bad_run_that_was_not_repeated_and_a_lost_run_are_told() -> None:
    assert faults(kept(), attempts=2) == [Fault.MISJUDGED, Fault.MISJUDGED]
    found = kept()
    del found.records["one-2/0"]
    assert [item.where for item in missing_runs(COURSE, found)] == ["salt one-2/0"]


@pytest.mark.parametrize(
    ("excuse", "left"),
    [
        (Excuse(MIDDLE, MIDDLE), 0),
        (Excuse(MIDDLE, MIDDLE, "salt", runs=1), 1),
        (Excuse(MIDDLE, MIDDLE, "salt", runs=2), 0),
        (Excuse(MIDDLE, MIDDLE, "other"), 2),
        (Excuse(MIDDLE + 6, MIDDLE + 60), 2),
        (Excuse(MIDDLE - 60, MIDDLE - 6), 2),
    ],
)
def test_what_was_done_to_a_run_excuses_that_run_alone(excuse: Excuse, left: int) -> None:
    found = kept()
    for record in found.records.values():
        record["verdict"] = "errored"
    assert len(faults(found, excuse)) == left


@pytest.mark.parametrize(
    ("hours", "left"), [(1, 0), (-1, 0), (0.1, 2)], ids=["ahead", "behind", "by no jump"]
)
def test_an_excuse_holds_where_the_clock_was_wrong_by_a_jump(hours: float, left: int) -> None:
    found = kept()
    for record in found.records.values():
        moments = {
            key: datetime.fromisoformat(record[key]) for key in ("started_at", "finished_at")
        }
        wrong = {key: (at + timedelta(hours=hours)).isoformat() for key, at in moments.items()}
        record.update(wrong, verdict="errored")
    assert len(faults(found, Excuse(MIDDLE, MIDDLE))) == left


def test_nothing_excuses_a_mixture() -> None:
    found = kept()
    found.records["one-1/0"]["verdict"] = "errored"
    found.files["one-1/0"]["last.txt"] = found.files["one-2/0"]["last.txt"]
    assert set(faults(found, Excuse(MIDDLE, MIDDLE))) == {Fault.MIXED}


def status(**changes: Any) -> dict[str, Any]:
    right = {"Succeeded": "True", "Passed": "False", "ResultsAvailable": "True"}
    return {
        "runs": {"total": 2, "stored": 2, "active": 0, "passed": 0, "failed": 2, "errored": 0},
        "failedRuns": "0-1",
        "conditions": [{"type": kind, "status": value} for kind, value in right.items()],
        **changes,
    }


def test_a_status_is_compared_with_the_records() -> None:
    assert compare_status(COURSE, status(), kept()) == []
    (wrong,) = compare_status(COURSE, status(failedRuns="1"), kept())
    assert "failedRuns" in wrong.text
    counted = {**status()["runs"], "failed": 1, "errored": 1}
    assert len(compare_status(COURSE, status(runs=counted), kept())) == 2
    assert len(compare_status(COURSE, status(conditions=[]), kept())) == 3


def test_an_execution_after_the_run_was_stored_is_told_unless_it_was_asked_for() -> None:
    begun = [Begun(10, "one-1/0", "a"), Begun(20, "one-1/0", "b")]
    stored = [Stored(15, "one-1/0", 1, "failed")]
    assert repeated("salt", begun, [], []) == []
    assert repeated("salt", begun, [Stored(25, "one-1/0", 1, "failed")], []) == []
    (found,) = repeated("salt", begun, stored, [])
    assert found.fault is Fault.REPEATED
    assert repeated("salt", begun, stored, [18]) == []
    assert len(repeated("salt", begun, [replace(stored[0], verdict="passed")], [18])) == 1


def test_results_are_read_without_following_links(tmp_path: Path) -> None:
    run = tmp_path / "one-1" / "0"
    (run / "deep").mkdir(parents=True)
    (run / "run.json").write_text(json.dumps({"verdict": "passed"}))
    (run / "deep" / "a").write_bytes(b"a")
    (run / "job").symlink_to(tmp_path)
    (tmp_path / "one-2" / "0").mkdir(parents=True)
    found = read_results(tmp_path)
    assert list(found.records) == ["one-1/0"]
    assert found.files["one-1/0"] == {"deep/a": b"a"}


def test_of_a_bucket_the_files_count_that_the_record_names(tmp_path: Path) -> None:
    run = tmp_path / "one-1" / "0"
    for writer in ("first", "second"):
        (run / writer).mkdir(parents=True)
        (run / writer / "a").write_text(writer)
        listed = [{"path": "a", "key": f"{writer}/a"}, {"path": "lost", "key": f"{writer}/lost"}]
        (run / f"{writer}.json").write_text(json.dumps({"files": listed}))
    (run / "run.json").write_text(json.dumps({"files": {"key": "second.json"}}))
    assert read_results(tmp_path).files["one-1/0"] == {"a": b"second"}
