"""JUnit reports: the test results of all runs of a campaign in one."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord, read_run_record, result_without_record
from robovast.campaign.verdict import Outcome, Verdict, outcome_of, read_report, seconds

LONGEST = 20_000
"""Longest text of a case [characters]; the run's own report has all of it."""

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML cannot hold."""


@dataclass(frozen=True)
class Case:
    """One test."""

    name: str
    outcome: Outcome = "passed"
    message: str = ""
    text: str = ""
    seconds: float | None = None


@dataclass(frozen=True)
class Suite:
    """Tests that belong together."""

    name: str
    cases: list[Case] = field(default_factory=list)
    properties: Mapping[str, str] = field(default_factory=dict)

    def count(self, outcome: Outcome) -> int:
        """Cases with this outcome."""
        return sum(case.outcome == outcome for case in self.cases)


def merged_suites(layout: Layout) -> list[Suite]:
    """One suite per variant with the cases of all its stored runs."""
    groups = groupby(layout.run_folders(), key=lambda run: run.parent.name)
    return [_suite(name, list(runs)) for name, runs in groups]


def _suite(name: str, runs: Sequence[Path]) -> Suite:
    records = [read_run_record(run) for run in runs]
    reused = sum(record is not None and bool(record.reused_from) for record in records)
    cases = [
        case for run, record in zip(runs, records, strict=True) for case in _cases(run, record)
    ]
    return Suite(name, cases, {"reused": f"{reused} of {len(runs)}"} if reused else {})


def report_text(name: str, suites: Sequence[Suite]) -> str:
    """A report as XML."""
    root = ET.Element("testsuites", _counts(name, suites))
    for suite in suites:
        element = ET.SubElement(root, "testsuite", _counts(suite.name, [suite]))
        if suite.properties:
            properties = ET.SubElement(element, "properties")
            for name, value in suite.properties.items():
                ET.SubElement(properties, "property", {"name": name, "value": _clean(value)})
        for case in suite.cases:
            _add(element, suite, case)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _counts(name: str, suites: Sequence[Suite]) -> dict[str, str]:
    seconds = sum(case.seconds or 0.0 for suite in suites for case in suite.cases)
    return {
        "name": _clean(name),
        "tests": str(sum(len(suite.cases) for suite in suites)),
        "failures": str(sum(suite.count("failure") for suite in suites)),
        "errors": str(sum(suite.count("error") for suite in suites)),
        "skipped": str(sum(suite.count("skipped") for suite in suites)),
        "time": f"{seconds:.3f}",
    }


def _add(parent: ET.Element, suite: Suite, case: Case) -> None:
    about = {"classname": _clean(suite.name), "name": _clean(case.name)}
    time = {} if case.seconds is None else {"time": f"{case.seconds:.3f}"}
    element = ET.SubElement(parent, "testcase", about | time)
    if case.outcome != "passed":
        said = ET.SubElement(element, case.outcome, {"message": _clean(case.message)})
        said.text = _clean(case.text) or None


def _clean(text: str) -> str:
    return _NO_XML.sub("�", text)[:LONGEST]


def _cases(run: Path, record: RunRecord | None) -> list[Case]:
    """The tests of a run; its verdict counts, whatever its own report says."""
    result = result_without_record(run) if record is None else record
    name = f"run {run.name}"
    if result.verdict is Verdict.INTERRUPTED:
        return [Case(name, "skipped", result.reason or "interrupted")]
    own = _own_cases(run, name)
    bad = any(case.outcome in {"failure", "error"} for case in own)
    if own and bad == (result.verdict is not Verdict.PASSED):
        return own
    outcomes: dict[Verdict, Outcome] = {Verdict.PASSED: "passed", Verdict.FAILED: "failure"}
    outcome = outcomes.get(result.verdict, "error")
    return [Case(name, outcome, result.reason, seconds=result.duration)]


def _own_cases(run: Path, name: str) -> list[Case]:
    """The cases of a run's own report; none if it cannot be read."""
    try:
        root = read_report(run)
    except (OSError, ValueError):
        return []
    return list(_cases_below(root, name, outcome_of(root)[0] == "skipped"))


def _cases_below(root: ET.Element, run: str, skipped: bool) -> Iterator[Case]:
    """The cases of a suite; all are skipped if the suite is. Suites may be nested very deeply."""
    waiting = [(child, skipped) for child in reversed(root)]
    while waiting:
        element, skipped = waiting.pop()
        if _tag(element) == "testcase":
            yield _case(element, run, skipped)
        else:
            skipped = skipped or outcome_of(element)[0] == "skipped"
            waiting += ((child, skipped) for child in reversed(element))


def _case(element: ET.Element, run: str, skipped: bool) -> Case:
    outcome, why = outcome_of(element)
    if skipped and outcome == "passed":
        outcome = "skipped"
    name = f"{run}: {element.get('name') or 'test'}"
    message, text = ("", "") if why is None else (why.get("message", ""), why.text or "")
    return Case(name, outcome, message, text, seconds(element.get("time")))


def _tag(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2].lower() if isinstance(element.tag, str) else ""
