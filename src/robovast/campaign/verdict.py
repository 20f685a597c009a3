"""The verdict in a test.xml: a JUnit report of scenario-execution or of another test tool.

The report is XML as `robovast.base.xml_files` supports it. The tables below list the elements,
counters and states that are understood, in the dialects of pytest, GoogleTest, CTest, Catch2,
behave, Surefire, Bazel, Playwright, Robot Framework, launch_testing, TestNG and Maestro. A report
that contains others in their place has no verdict.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from robovast.base.safe_paths import read_file
from robovast.base.xml_files import UnsupportedXmlError, parse_xml
from robovast.campaign.layout import TEST_RESULT

Outcome = Literal["passed", "failure", "error", "skipped"]


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
    report = _Report()
    try:
        read_report(run, root, report)
    except FileNotFoundError:
        return TestResult(Verdict.ERRORED, f"the run wrote no {TEST_RESULT}")
    except OSError as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} cannot be read: {error.strerror}")
    except UnsupportedXmlError as error:
        return _no_report(str(error))
    except ValueError as error:
        return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is not valid: {error}")
    return report.result()


def read_report(run: Path, root: Path | None = None, target: Any = None) -> Any:
    """Parse the test.xml in a run's folder.

    Args:
        run: the folder.
        root: ancestor below which no link is followed; None means the folder itself.
        target: see `parse_xml`.

    Returns:
        As `parse_xml`: by default, the outermost element.

    Raises:
        OSError: the file is missing, is not a regular file, or has more than `MOST` bytes.
        ValueError: as in `parse_xml`.
    """
    return parse_xml(read_file(run / TEST_RESULT, root or run.parent, MOST), target)


def _no_report(why: str) -> TestResult:
    return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is not a JUnit report: {why}")


_SUITES = ("testsuite", "testsuites")
_HOLDERS = {**dict.fromkeys(_SUITES, "suite"), "testcase": "test case"}
_BAD = frozenset({"failure", "error", "rerunfailure", "rerunerror", "flakyfailure", "flakyerror"})
"""Child elements of a failed case, lower case; Surefire's report failed executions."""
_NOT_RUN = frozenset({"skipped", "disabled", "ignored"})
"""Child elements of a case that was not executed."""
_BAD_COUNTS = (
    *("failures", "failure", "failed", "errors", "error", "flakes"),
    *("timedout", "aborted", "crashed", "broken", "unexpected"),
)
_NOT_RUN_COUNTS = (
    *("skipped", "disabled", "ignored", "notrun", "not-run", "skips", "skip", "inconclusive"),
)
_QUIET = frozenset(
    {"properties", "property", "system-out", "system-err", "attachments", "annotations"}
)
"""Child elements of a suite or case that do not change its outcome."""
_STATES = {
    **dict.fromkeys(
        ("", "run", "completed", "passed", "pass", "success", "successful", "ok", "fixed"), "ran"
    ),
    **dict.fromkeys(("notrun", "skipped", "skip", "disabled", "ignored", "suppressed"), "not run"),
    **dict.fromkeys(("pending", "untested", "untested_pending", "untested_undefined"), "not run"),
    **dict.fromkeys(
        ("fail", "failed", "failure", "error", "errored", "broken", "regression"), "bad"
    ),
    **dict.fromkeys(("undefined", "hook_error", "cleanup_error"), "bad"),
}
"""Meaning of `_STATE_KEYS`, as written by GoogleTest, CTest, behave and others."""
_FLAGS = {
    "success": {"true": "ran", "1": "ran", "false": "bad", "0": "bad"},
    "executed": {"true": "ran", "1": "ran", "false": "not run", "0": "not run"},
}
"""Meaning of truth values, as written by NUnit and others."""
_SUSPECT = re.compile(r"fail|error|crash|time[d_-]*out|abort|incomplete|verdict|conclusion")
"""Attributes that may contradict a passed report, if they are in none of the tables."""
_HARMLESS = frozenset({"", "0", "false", "no", "none", "passed", "success"})
_SKIPPED_BY_CTEST = ("SKIP_RETURN_CODE=", "SKIP_REGULAR_EXPRESSION_MATCHED", "Disabled")
"""Beginnings of the reasons for which CTest does not count a test that did not run as failed."""

_Attributes = list[tuple[str, str]]
"""Attributes by lower-case name; a name may occur several times, and each value counts."""


@dataclass
class _Suite:
    """Counts of a suite and the suites in it."""

    said: int = 0
    """Number of tests that the suite declares."""
    said_not_run: Sequence[int] = ()
    """Its counters of tests that did not run."""
    skipped: bool = False
    """Whether the suite declares that it did not run."""
    catch2: bool = False
    """Whether the suite has the mark of Catch2, whose counters count assertions."""
    may_be_catch2: bool = False
    """Whether the suite and all its cases look as Catch2 writes them, without the mark."""
    cases: int = 0
    not_run: int = 0


class _Report:
    """The content of a JUnit report, collected while it is parsed.

    Names are compared without letter case and namespace.
    """

    def __init__(self) -> None:
        self._root = ""
        self._bare = False
        """Whether the outermost element has no attributes."""
        self._pytest = False
        """Whether pytest wrote the report; its counters include subtests, which are no elements."""
        self._open: list[str] = []
        """Names of the open elements."""
        self._whole = _Suite()
        self._suites = [self._whole]
        """Open suites; the first is the report itself."""
        self._suite_count = self._bad = 0
        self._case_not_run = self._not_started = False
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
        if not self._root:
            self._root, self._bare = name, not said
            self._pytest = name == "testsuites" and ("name", "pytest tests") in said
        if name in _SUITES:
            self._start_suite(name, said)
        elif name == "testcase":
            self._start_case(said)
            if self._open[-1:] not in (["testsuite"], ["testsuites"]):
                self._doubt = "a test case is not directly in a suite"
        elif name in _NOT_RUN and self._open[-1:] == ["testcase"]:
            self._skip(dict(said).get("message", "").strip())
        elif name in _BAD:
            self._bad += 1
            self._text = []
            message = dict(said).get("message", "").strip()
            self._failures.setdefault(name, (message, self._text))
        elif self._open and self._open[-1] in _HOLDERS and name not in _QUIET:
            what = _HOLDERS[self._open[-1]]
            self._doubt = f"a {what} contains a `{name[:40]}`, which is not known"
        elif ("name", "start_time") in said and self._started_at is None:
            self._started_at = seconds(dict(said).get("value"))
        self._open.append(name)

    def _start_suite(self, name: str, said: _Attributes) -> None:
        self._suite_count += name == "testsuite"
        states = self._known_states("suite", said)
        self._bad += sum(_counts(said, *_BAD_COUNTS)) + states.count("bad")
        not_run = _counts(said, *_NOT_RUN_COUNTS)
        tests = max(_counts(said, "tests", "total"), default=0)
        suite = _Suite(tests, not_run, "not run" in states)
        suite.catch2 = ("hostname", "tbd") in said
        suite.may_be_catch2 = self._bare and self._root == "testsuites"
        self._suites.append(suite)
        duration = seconds(dict(said).get("time"))
        if duration is not None and len(self._suites) in self._durations:
            self._durations[len(self._suites)].append(duration)

    def _start_case(self, said: _Attributes) -> None:
        suite = self._suites[-1]
        suite.cases += 1
        suite.may_be_catch2 &= [pair for pair in said if pair[0] in _STATE_KEYS] == _CATCH2_STATE
        states = self._known_states("test case", said)
        self._bad += sum(_counts(said, *_BAD_COUNTS)) + states.count("bad")
        self._case_not_run = "not run" in states
        self._not_started = ("status", "notrun") in said

    def _skip(self, why: str) -> None:
        self._case_not_run = True
        if self._not_started and not why.startswith(_SKIPPED_BY_CTEST):
            self._doubt = f"a test case could not be run: {why[:80] or 'no reason is given'}"

    def _known_states(self, what: str, said: _Attributes) -> list[str]:
        """Meaning of each state; an unknown one makes the report inconclusive."""
        found = []
        for key, text in said:
            if key in _STATE_KEYS or key in _FLAGS:
                state = _FLAGS.get(key, _STATES).get(text.strip().lower())
                if state is None:
                    self._doubt = f"a {what} has the {key} `{text[:40]}`, which is not known"
                else:
                    found.append(state)
            elif _is_suspect(key, text.strip().lower()):
                self._doubt = f"a {what} has the {key[:40]} `{text[:40]}`, which is not known"
        return found

    def data(self, text: str) -> None:
        """Handle text in an element."""
        if self._text is not None:
            self._text.append(text)

    def end(self, tag: str) -> None:
        """Handle the end of an element."""
        self._text = None
        self._open.pop()
        name = _plain(tag)
        if name == "testcase":
            self._suites[-1].not_run += self._case_not_run
        elif name in _SUITES:
            self._end_suite(self._suites.pop())

    def _end_suite(self, suite: _Suite) -> None:
        if self._pytest and suite.cases:
            suite.cases = max(suite.cases, suite.said)
        catch2 = suite.cases > 0 and (suite.catch2 or suite.may_be_catch2)
        not_run = suite.not_run
        if not catch2 and not_run < max(suite.said_not_run, default=0):
            not_run = min(sum(suite.said_not_run), suite.cases)
        self._suites[-1].cases += suite.cases
        self._suites[-1].not_run += suite.cases if suite.skipped else not_run
        if suite.said > suite.cases and not catch2:
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
            return TestResult(Verdict.ERRORED, f"{TEST_RESULT} is inconclusive: {why}")
        return TestResult(Verdict.PASSED, "", self._started_at, duration)

    def _failure(self) -> TestResult:
        from robovast.campaign.reasons import plain  # which a run that passed does without

        stated = [self._failures[name] for name in ("failure", "error") if name in self._failures]
        message, text = next(iter([*stated, *self._failures.values()]), ("", []))
        if message == _PARSING_FAILED:
            why = next(iter("".join(text).strip().splitlines()), "")
            return TestResult(Verdict.ERRORED, f"the scenario cannot be parsed: {plain(why)}")
        return _failed("" if message == _NO_MESSAGE else message, "".join(text))


def outcome_of(element: ET.Element) -> tuple[Outcome, ET.Element | None]:
    """Return what a suite or case declares as its outcome, and the child element that explains it.

    Failures precede errors, and both precede skipped cases.
    """
    children = {_plain(child.tag): child for child in element if isinstance(child.tag, str)}
    said = {_plain(key): value.strip().lower() for key, value in element.attrib.items()}
    states = {_STATES.get(said.get(key, "")) for key in _STATE_KEYS}
    bad = sorted(_BAD & children.keys(), key=lambda name: name.endswith("error"))
    not_run = sorted(_NOT_RUN & children.keys())
    if bad or "bad" in states:
        why = children[bad[0]] if bad else None
        return ("error" if bad and bad[0].endswith("error") else "failure"), why
    if not_run or "not run" in states:
        return "skipped", children[not_run[0]] if not_run else None
    return "passed", None


def _is_suspect(key: str, value: str) -> bool:
    if key == "passed":
        return value in {"0", "false", "no"}
    is_known = key in _BAD_COUNTS or key in _NOT_RUN_COUNTS
    return not is_known and value not in _HARMLESS and _SUSPECT.search(key) is not None


def _plain(name: str) -> str:
    """An XML name in lower case, without namespace."""
    return name.rpartition("}")[2].lower()


_STATE_KEYS = ("status", "result", "outcome", "state")
_CATCH2_STATE = [("status", "run")]
_COUNT = re.compile(r"\s*([0-9]{0,18})(?:\.0*)?\s*")


def _counts(said: _Attributes, *names: str) -> list[int]:
    """All counters with these names; some tools write `1.0`, or truth values."""
    found = []
    for name, text in said:
        if name in names:
            number = _COUNT.fullmatch({"true": "1", "false": "0"}.get(text.lower(), text))
            if number is None:
                raise ValueError(f"`{name}` is {text[:40]}, which is not a count")
            found.append(int(number[1] or 0))
    return found


_LATEST = float(1 << 33)
"""Largest plausible time or duration [s]; a calendar must hold the sum of two."""


_GROUPED = re.compile(r"\s*[0-9]{1,3}(,[0-9]{3})+\.[0-9]+\s*")
"""A number as Surefire and JUnit 5 write it. Without a point, the comma may be a decimal one."""


def seconds(text: str | None) -> float | None:
    """A duration or a time [s]; None if it is missing, implausible or ambiguous."""
    text = text or "nan"
    try:
        number = float(text.replace(",", "") if _GROUPED.fullmatch(text) else text)
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
    stated = [node for node in failed if node["said"]] or [node for node in failed if node["leaf"]]
    if stated:
        return stated[-1]["name"], stated[-1]["said"] or ""
    if failed and nodes[-1]["leaf"] and nodes[-1]["state"] == "-":
        return nodes[-1]["name"], "stopped by the scenario's timeout"
    return "", ""
