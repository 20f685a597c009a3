"""The verdict in the test.xml (JUnit) that scenario-execution writes."""

from __future__ import annotations

import xml.etree.ElementTree as ET  # entities are refused below
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from robovast.base.safe_paths import read_text
from robovast.campaign.layout import TEST_RESULT


class Verdict(StrEnum):
    """How a run ended."""

    PASSED = "passed"
    FAILED = "failed"
    """The scenario ran and failed: a result, not an error."""
    ERRORED = "errored"
    """No verdict: a crash, a timeout, a missing test.xml."""
    INTERRUPTED = "interrupted"
    """Stopped by the user; the run counts as not executed."""


@dataclass(frozen=True)
class TestResult:
    """The content of test.xml.

    Attributes:
        verdict: passed or failed; errored if the file cannot be interpreted.
        reason: the first failure's message, or why there is no verdict; empty when passed.
        started_at: start of the scenario [s since the epoch]; None if missing or implausible.
        duration: [s]; None if missing or implausible.
    """

    __test__ = False  # not a test class, despite its name

    verdict: Verdict
    reason: str = ""
    started_at: float | None = None
    duration: float | None = None


MOST = 16 << 20
"""Most of a test result that is read [bytes]."""


def read_test_result(run: Path, root: Path | None = None) -> TestResult:
    """Read the test result in a run's folder; unreadable results are `errored`, never exceptions.

    Args:
        run: the folder.
        root: ancestor below which no link is followed; None means the folder itself.
    """
    try:
        text = read_text(run / TEST_RESULT, root=root or run.parent, most=MOST)
    except FileNotFoundError:
        return TestResult(Verdict.ERRORED, f"the run wrote no {TEST_RESULT}")
    except OSError as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} cannot be read: {error.strerror}")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        return _no_report("it declares a document type or entities")
    report = _Report()
    parser = ET.XMLParser(target=report)  # noqa: S314  # no entities, see above
    try:
        parser.feed(text)
        parser.close()
    except (ET.ParseError, ValueError) as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is not valid: {error}")
    return report.result()


def _no_report(why: str) -> TestResult:
    return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is not a JUnit report: {why}")


_SUITES = ("testsuite", "testsuites")
_BAD = frozenset({"failure", "error", "rerunfailure", "rerunerror", "flakyfailure", "flakyerror"})
"""Child elements of a failed case, lower case; Surefire's report failed executions."""
_NOT_RUN = frozenset({"skipped", "disabled", "ignored"})
"""Child elements of a case that was not executed."""
_BAD_COUNTS = ("failures", "errors", "flakes", "failed")
_NOT_RUN_COUNTS = ("skipped", "disabled", "ignored", "notrun", "skips", "skip")
_STATES = {
    **dict.fromkeys(
        ("", "run", "completed", "passed", "pass", "success", "successful", "ok", "fixed"), "ran"
    ),
    **dict.fromkeys(
        ("notrun", "skipped", "skip", "disabled", "ignored", "suppressed", "pending"), "not run"
    ),
    **dict.fromkeys(
        ("fail", "failed", "failure", "error", "errored", "broken", "regression"), "bad"
    ),
}
"""Meaning of a case's `status` and `result`, as written by GoogleTest, CTest and others."""

_Attributes = list[tuple[str, str]]
"""Attributes by lower-case name; a name may occur several times, and each value counts."""


@dataclass
class _Suite:
    """Counts of a suite and the suites in it."""

    said: int = 0
    """Number of tests that the suite declares."""
    said_not_run: int = 0
    cases: int = 0
    not_run: int = 0


class _Report:
    """The content of a JUnit report, collected while it is parsed.

    Names are compared without letter case and namespace.
    """

    def __init__(self) -> None:
        self._root = ""
        self._whole = _Suite()
        self._suites = [self._whole]
        """Open suites; the first is the report itself."""
        self._suite_count = self._bad = 0
        self._case_not_run = False
        """Attributes of the open case."""
        self._doubt = ""
        """Why the report is not conclusive."""
        self._started_at: float | None = None
        self._durations: dict[int, list[float]] = {2: [], 3: []}
        """Totals over the top-level suites, including nested ones."""
        self._failures: dict[str, tuple[str, list[str]]] = {}
        """Message and text of the first failure and of the first error."""
        self._text: list[str] | None = None
        """Text of the open failure."""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Handle the start of an element."""
        name = _plain(tag)
        said = [(_plain(key), value) for key, value in attributes.items()]
        self._root = self._root or name
        if name in _SUITES:
            self._start_suite(name, said)
        elif name == "testcase":
            self._start_case(said)
        elif name in _NOT_RUN:
            self._case_not_run = True
        elif name in _BAD:
            self._bad += 1
            self._text = []
            message = dict(said).get("message", "").strip()
            self._failures.setdefault(name, (message, self._text))
        elif ("name", "start_time") in said and self._started_at is None:
            self._started_at = _seconds(dict(said).get("value"))

    def _start_suite(self, name: str, said: _Attributes) -> None:
        self._suite_count += name == "testsuite"
        self._bad += _count(said, *_BAD_COUNTS) + [*_states(said).values()].count("bad")
        self._suites.append(_Suite(_count(said, "tests"), _count(said, *_NOT_RUN_COUNTS)))
        duration = _seconds(dict(said).get("time"))
        if duration is not None and len(self._suites) in self._durations:
            self._durations[len(self._suites)].append(duration)

    def _start_case(self, said: _Attributes) -> None:
        self._case_not_run = False
        self._suites[-1].cases += 1
        for (key, text), state in _states(said).items():
            self._bad += state == "bad"
            self._case_not_run |= state == "not run"
            if state is None:
                self._doubt = f"a test case has the {key} `{text[:40]}`, which is not known"

    def data(self, text: str) -> None:
        """Handle text in an element."""
        if self._text is not None:
            self._text.append(text)

    def end(self, tag: str) -> None:
        """Handle the end of an element."""
        self._text = None
        name = _plain(tag)
        if name == "testcase":
            self._suites[-1].not_run += self._case_not_run
        elif name in _SUITES:
            suite = self._suites.pop()
            self._suites[-1].cases += suite.cases
            self._suites[-1].not_run += max(suite.not_run, suite.said_not_run)
            if suite.said > suite.cases:
                self._doubt = f"a suite of {suite.said} tests has {suite.cases} of them"

    def close(self) -> None:
        """Handle the end of the report."""

    def result(self) -> TestResult:
        """The verdict: passed requires at least one case and no failure in any suite."""
        if self._root not in _SUITES:
            return _no_report(f"its outermost element is `{self._root[:40]}`")
        duration = next((sum(d) for d in self._durations.values() if d), None)
        if self._bad:
            return TestResult(Verdict.FAILED, self._failure(), self._started_at, duration)
        why = self._doubt
        if not self._suite_count or not self._whole.cases:
            why = "it has no test case"
        elif self._whole.not_run >= self._whole.cases:
            why = "all of its test cases were skipped"
        if why:
            return TestResult(Verdict.ERRORED, f"{TEST_RESULT} says nothing: {why}")
        return TestResult(Verdict.PASSED, "", self._started_at, duration)

    def _failure(self) -> str:
        told = [self._failures[name] for name in ("failure", "error") if name in self._failures]
        message, text = next(iter([*told, *self._failures.values()]), ("", []))
        return ": ".join(filter(None, (message, _detail("".join(text))))) or "the scenario failed"


def _plain(name: str) -> str:
    """An XML name in lower case, without namespace."""
    return name.rpartition("}")[2].lower()


def _states(said: _Attributes) -> dict[tuple[str, str], str | None]:
    """Meaning of each `status` and `result`; None if it is unknown."""
    found = (pair for pair in said if pair[0] in {"status", "result"})
    return {pair: _STATES.get(pair[1].strip().lower()) for pair in found}


def _count(said: _Attributes, *names: str) -> int:
    """Sum of all counters with these names."""
    numbers = [(name, int(text or 0)) for name, text in said if name in names]
    for name, number in numbers:
        if number < 0:
            raise ValueError(f"`{name}` is {number}")
    return sum(number for _, number in numbers)


_LATEST = float(1 << 33)
"""Largest plausible time or duration [s]; a calendar must hold the sum of two."""


def _seconds(text: str | None) -> float | None:
    try:
        number = float(text or "nan")
    except ValueError:
        return None
    return number if 0 <= number < _LATEST else None


_FAILED_LEAF = "[✕] -- "
"""Marks the message of the failed behaviour in a printed behaviour tree."""
_TREE = ("-^-", "[", "{", "-->", "/_/")
"""Line prefixes of a printed behaviour tree; such lines alone say little."""


def _detail(text: str, limit: int = 200) -> str:
    """Message of the failed behaviour, or the first line; shortened in the middle."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    failed = [line.partition(_FAILED_LEAF)[2] for line in lines if _FAILED_LEAF in line]
    first = "" if not lines or lines[0].startswith(_TREE) else lines[0]
    detail = failed[-1] if failed else first
    if len(detail) <= limit:
        return detail
    return f"{detail[: limit // 2]} … {detail[-limit // 2 :]}"
