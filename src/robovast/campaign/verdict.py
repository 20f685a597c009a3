"""The verdict in the test.xml (JUnit) that scenario-execution writes."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET  # entities are refused below
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    """No verdict: a crash, a timeout, a missing test.xml, a scenario that cannot be parsed."""
    INTERRUPTED = "interrupted"
    """Stopped by the user; the run counts as not executed."""

    __hash__ = str.__hash__
    """That of enumerations is slow, which shows when 100,000 runs are counted."""


@dataclass(frozen=True)
class TestResult:
    """The content of test.xml.

    Attributes:
        verdict: passed or failed; errored if the file cannot be interpreted.
        reason: the first failure's message, or why there is no verdict; empty when passed.
        started_at: start of the scenario [s since the epoch]; None if missing or implausible.
        duration: [s]; None if missing or implausible.
        action: the scenario's action that failed; empty if unknown.
        explained: False if the reason only says that the action, or its process, failed.
    """

    __test__ = False  # not a test class, despite its name

    verdict: Verdict
    reason: str = ""
    started_at: float | None = None
    duration: float | None = None
    action: str = ""
    explained: bool = True


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
            failed = self._failure()
            return replace(failed, started_at=self._started_at, duration=duration)
        why = self._doubt
        if not self._suite_count or not self._whole.cases:
            why = "it has no test case"
        elif self._whole.not_run >= self._whole.cases:
            why = "all of its test cases were skipped"
        if why:
            return TestResult(Verdict.ERRORED, f"{TEST_RESULT} says nothing: {why}")
        return TestResult(Verdict.PASSED, "", self._started_at, duration)

    def _failure(self) -> TestResult:
        from robovast.campaign.reasons import plain  # which a run that passed does without

        told = [self._failures[name] for name in ("failure", "error") if name in self._failures]
        message, text = next(iter([*told, *self._failures.values()]), ("", []))
        if message == _PARSING_FAILED:
            why = next(iter("".join(text).strip().splitlines()), "")
            return TestResult(Verdict.ERRORED, f"the scenario cannot be parsed: {plain(why)}")
        return _failed("" if message == _NO_MESSAGE else message, "".join(text))


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


_PARSING_FAILED = "parsing failed"
"""Of scenario-execution, for a scenario or parameters that it cannot read: nothing was tried."""
_NO_MESSAGE = "execution failed."
"""Of scenario-execution, for every failure of a scenario."""
_NODE = re.compile(
    r"(?:(?P<leaf>-->)|-\^-|\{.\}|\[.\]|/_/) (?P<name>.+?) \[(?P<state>.)\](?: -- (?P<said>.*))?"
)
"""A line of a printed behaviour tree."""
_TREE = ("-^-", "[", "{", "-->", "/_/")
"""Line prefixes of a printed behaviour tree; such lines alone say little."""


def _failed(message: str, text: str) -> TestResult:
    """A failure, by the action that failed in a printed behaviour tree, or else its first line."""
    from robovast.campaign.reasons import is_command, plain

    lines = [line.strip() for line in text.splitlines() if line.strip()]
    action, said = _failed_action([node for node in map(_NODE.fullmatch, lines) if node])
    if not action:
        said = "" if not lines or lines[0].startswith(_TREE) else lines[0]
    parts = [plain(part) for part in (message, action, said) if part]
    explained = bool(said or (message and not action)) and not is_command(said)
    if action and not said:
        parts[-1] += " failed"
    reason = ": ".join(parts) or "the scenario failed"
    return TestResult(Verdict.FAILED, reason, action=plain(action), explained=explained)


def _failed_action(nodes: Sequence[re.Match[str]]) -> tuple[str, str]:
    """The action that failed and what it said; empty if unknown."""
    failed = [node for node in nodes if node["state"] == "✕"]
    told = [node for node in failed if node["said"]] or [node for node in failed if node["leaf"]]
    if told:
        return told[-1]["name"], told[-1]["said"] or ""
    if failed and nodes[-1]["leaf"] and nodes[-1]["state"] == "-":
        return nodes[-1]["name"], "stopped by the scenario's timeout"
    return "", ""
