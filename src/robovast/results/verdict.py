"""The verdict of a run, from the test.xml (JUnit) that scenario-execution writes."""

from __future__ import annotations

import xml.etree.ElementTree as ET  # entities are refused below
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from robovast.results.layout import TEST_RESULT


class Verdict(StrEnum):
    """How a run ended."""

    PASSED = "passed"
    FAILED = "failed"
    """The scenario ran and said no: a result, not an error."""
    ERRORED = "errored"
    """No verdict: a crash, a timeout, a missing test.xml."""
    INTERRUPTED = "interrupted"
    """Stopped by the user; the run counts as not executed."""


@dataclass(frozen=True)
class TestResult:
    """What test.xml says.

    Attributes:
        verdict: passed or failed; errored when the file says nothing that can be read.
        reason: the first failure's message, or why there is no verdict; empty when passed.
        started_at: start of the scenario [s since the epoch].
        duration: [s]
    """

    __test__ = False  # not a test class, whatever its name

    verdict: Verdict
    reason: str = ""
    started_at: float | None = None
    duration: float | None = None


def read_test_result(run: Path) -> TestResult:
    """The test result in a run's folder; never raises: what cannot be read is `errored`."""
    path = run / TEST_RESULT
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return TestResult(Verdict.ERRORED, f"the run wrote no {TEST_RESULT}")
    except OSError as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} cannot be read: {error.strerror}")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} declares entities, which none needs")
    try:
        suite = ET.fromstring(text)  # noqa: S314  # no entities, see above
        return _parse(suite)
    except (ET.ParseError, ValueError) as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is not valid: {error}")


def _parse(suite: ET.Element) -> TestResult:
    if suite.tag == "testsuites":
        suite = suite if suite.get("failures") else next(iter(suite), suite)
    bad = int(suite.get("failures") or 0) + int(suite.get("errors") or 0)
    start = suite.find(".//property[@name='start_time']")
    started_at = float(start.get("value") or 0) if start is not None else None
    duration = float(suite.get("time") or 0)
    if not bad:
        return TestResult(Verdict.PASSED, "", started_at, duration)
    return TestResult(Verdict.FAILED, _failure(suite), started_at, duration)


_FAILED_LEAF = "[✕] -- "
"""In a drawn behaviour tree, what precedes the message of the behaviour that failed."""
_TREE = ("-^-", "[", "{", "-->", "/_/")
"""How the lines of a drawn behaviour tree begin; they say little without the rest of it."""


def _failure(suite: ET.Element) -> str:
    failure = suite.find(".//failure")
    if failure is None:
        failure = suite.find(".//error")
    if failure is None:
        return "the scenario failed"
    message = (failure.get("message") or "").strip()
    return ": ".join(filter(None, (message, _detail(failure.text or "")))) or "the scenario failed"


def _detail(text: str, limit: int = 200) -> str:
    """The message of the behaviour that failed, or the first line; shortened in the middle."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    failed = [line.partition(_FAILED_LEAF)[2] for line in lines if _FAILED_LEAF in line]
    first = "" if not lines or lines[0].startswith(_TREE) else lines[0]
    detail = failed[-1] if failed else first
    if len(detail) <= limit:
        return detail
    return f"{detail[: limit // 2]} … {detail[-limit // 2 :]}"
