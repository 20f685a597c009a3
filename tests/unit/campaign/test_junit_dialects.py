"""Reports of other test tools have the verdict that the tool means, or none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.campaign.verdict import Verdict, read_test_result

CASES = Path(__file__).parents[2] / "data/cases/junit"
RIGHT = [line.split("\t")[:2] for line in (CASES / "RIGHT.tsv").read_text("utf-8").splitlines()]
FURTHER = [line.split("\t") for line in (CASES / "further.tsv").read_text().splitlines()]
NOT_DEFINED = {"ansi-raw-pass", "status-int"}


@pytest.mark.parametrize(("name", "verdict"), RIGHT)
def test_the_report_of_a_tool_has_its_verdict(name: str, verdict: str) -> None:
    result = read_test_result(CASES / name / "0")
    assert result.verdict == (Verdict.ERRORED if name in NOT_DEFINED else verdict)
    assert bool(result.reason) == (result.verdict is not Verdict.PASSED)


def result_of(folder: Path, text: str):
    (folder / "test.xml").write_text(text)
    return read_test_result(folder)


SUBTESTS = """
import pytest

def test_each(subtests):
    for step in {steps}:
        with subtests.test(step=step):
            if step == "skip":
                pytest.skip("not here")
            assert step == "pass"
"""


@pytest.mark.parametrize(
    ("steps", "verdict"),
    [
        (["pass"] * 10, Verdict.PASSED),
        (["pass", "skip", "skip", "pass"], Verdict.PASSED),
        (["pass", "fail", "pass"], Verdict.FAILED),
        (["fail", "skip"], Verdict.FAILED),
    ],
)
def test_subtests_of_pytest_count(tmp_path: Path, steps: list[str], verdict: Verdict) -> None:
    (tmp_path / "test_steps.py").write_text(SUBTESTS.format(steps=steps))
    command = [sys.executable, "-m", "pytest", "--junit-xml=test.xml", "-p", "no:cacheprovider"]
    subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, timeout=60)
    assert read_test_result(tmp_path).verdict is verdict


CATCH2_RUN = (
    '<testsuites><testsuite name="arm" errors="0" failures="0" skipped="1" tests="{}">{}'
    "</testsuite></testsuites>"
)
CASE = '<testcase classname="g" name="a" time="0" status="run">{}</testcase>'


@given(
    cases=st.integers(1, 5),
    skipped=st.integers(0, 5),
    assertions=st.integers(0, 500),
    mark=st.sampled_from(["", 'hostname="tbd" ']),
)
def test_catch2_counts_assertions(tmp_path_factory, cases, skipped, assertions, mark) -> None:
    found = CASE.format("") * cases + CASE.format('<skipped message="no arm"/>') * skipped
    text = CATCH2_RUN.format(assertions, found).replace("name=", mark + "name=", 1)
    result = result_of(tmp_path_factory.mktemp("c"), text)
    assert result.verdict is Verdict.PASSED, result.reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        # Catch2: every test was skipped; no test; another tool's suite lacks two of its tests
        (
            CATCH2_RUN.format(1, CASE.format("<skipped/>")),
            "all of its test cases were skipped",
        ),
        (
            CATCH2_RUN.format(4, ""),
            "it has no test case",
        ),
        (
            '<testsuites id="x"><testsuite tests="3"><testcase status="run"/></testsuite>'
            "</testsuites>",
            "a suite of 3 tests has 1 of them",
        ),
        (
            '<testsuites><testsuite tests="3"><testcase status="run" result="completed"/>'
            "</testsuite></testsuites>",
            "a suite of 3 tests has 1 of them",
        ),
        (
            '<testsuites><testsuite tests="3"><testcase/></testsuite></testsuites>',
            "a suite of 3 tests has 1 of them",
        ),
        # CTest counts a test that it could not start as failed
        (
            '<testsuite tests="2"><testcase status="run"/><testcase status="notrun">'
            '<skipped message="Unable to find executable"/></testcase></testsuite>',
            "a test case could not be run: Unable to find executable",
        ),
        # behave: a dry run, and a state of a later version
        ('<testsuite><testcase status="untested"/></testsuite>', "were skipped"),
        (
            '<testsuite><testcase status="passed"/><testcase status="pending_warn"/></testsuite>',
            "the status `pending_warn`, which is not known",
        ),
        # the suite itself
        ('<testsuite status="crashed"><testcase/></testsuite>', "a suite has the status `crashed`"),
        ('<testsuite result="skipped"><testcase/></testsuite>', "were skipped"),
        # elements in a case that no table lists
        ("<testsuite><testcase><failed/></testcase></testsuite>", "contains a `failed`"),
        (
            "<testsuite><testcase><internalError/></testcase></testsuite>",
            "contains a `internalerror`",
        ),
        (
            "<testsuite><testcase><warning>x</warning></testcase></testsuite>",
            "contains a `warning`",
        ),
        ('<testsuite tests="1.5"><testcase/></testsuite>', "`tests` is 1.5"),
        ('<testsuite tests="1_0"><testcase/></testsuite>', "`tests` is 1_0"),
        ('<testsuite failures="1e0"><testcase/></testsuite>', "`failures` is 1e0"),
        ('<testsuite errors="nan"><testcase/></testsuite>', "`errors` is nan"),
        ('<testsuite skipped="1,000"><testcase/></testsuite>', "`skipped` is 1,000"),
        ('<testsuite tests="٣"><testcase/></testsuite>', "`tests` is ٣"),
    ],
)
def test_what_is_not_understood_is_errored(tmp_path: Path, text: str, reason: str) -> None:
    result = result_of(tmp_path, text)
    assert result.verdict is Verdict.ERRORED
    assert reason in result.reason


@pytest.mark.parametrize(("verdict", "text"), FURTHER)
def test_further_reports_of_each_tool(tmp_path: Path, verdict: str, text: str) -> None:
    assert result_of(tmp_path, text).verdict == verdict


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("1,515.25", 1515.25),
        ("1,000,000.5", 1000000.5),
        ("1,5", None),
        ("1,515", None),
        ("12,34.5", None),
    ],
)
def test_a_comma_in_a_time_counts_only_where_it_has_one_meaning(
    tmp_path: Path, text: str, seconds: float | None
) -> None:
    result = result_of(tmp_path, f'<testsuite time="{text}"><testcase/></testsuite>')
    assert (result.verdict, result.duration) == (Verdict.PASSED, seconds)


NOT_RUN = ["skipped", "skips", "skip", "disabled", "ignored", "notrun", "not-run"]


@given(
    suites=st.lists(
        st.tuples(
            st.integers(0, 3),
            st.integers(0, 3),
            st.sets(st.sampled_from(NOT_RUN), max_size=4),
            st.booleans(),
        ),
        min_size=1,
        max_size=4,
    ),
    nested=st.booleans(),
)
def test_counters_of_one_case_do_not_hide_executed_ones(tmp_path_factory, suites, nested) -> None:
    """Several counters may count the same cases, and one may be larger than its suite."""
    text, executed = "", 0
    for ran, skipped, counters, bare in suites:
        # a suite whose only mark is a counter that is too large did not run
        marks = "<testcase/>" * (ran + skipped) if bare else "<testcase/>" * ran
        marks += "" if bare else "<testcase><skipped/></testcase>" * skipped
        counted = dict.fromkeys(counters, skipped) if not bare else {"skipped": 5 + ran}
        said = "".join(f' {name}="{count}"' for name, count in counted.items())
        text += f'<testsuite tests="{ran + skipped}"{said}>{marks}</testsuite>'
        executed += 0 if bare else ran
    text = f"<testsuites>{f'<testsuite>{text}</testsuite>' if nested else text}</testsuites>"
    result = result_of(tmp_path_factory.mktemp("c"), text)
    assert result.verdict is (Verdict.PASSED if executed else Verdict.ERRORED), result.reason


CASE_SAYS = [
    'success="false"',
    'success="0"',
    'outcome="failed"',
    'outcome="Error"',
    'outcome="exploded"',
    'state="failed"',
    'state="aborted"',
    'result="timeout"',
    'executed="false"',
    'failures="1"',
    'error="true"',
]
COUNTERS = ["failure", "error", "failed", "timedout", "aborted", "crashed", "broken", "unexpected"]
ELEMENTS = ["crash", "timeout", "fatal", "skipped", "case", "failures"]
ORDINARY = [
    'assertions="1"',
    'file="a.py" line="3"',
    'classname="c" time="0.1" device="x"',
    'success="True" executed="True"',
    'outcome="passed"',
    'state="completed"',
    'timestamp="2026-01-01T00:00:00" hostname="h" id="0" package="p"',
    'retries="0" flaky="false" type="t"',
    'failures="0" errors="0" timedout="0" aborted="0" failure="false"',
]


@given(
    fault=st.sampled_from(CASE_SAYS).map(lambda said: (said, "", ""))
    | st.sampled_from(COUNTERS).map(lambda name: ("", f'{name}="1"', ""))
    | st.sampled_from(ELEMENTS).map(lambda name: ("", "", f"<{name}/>")),
    ordinary=st.tuples(st.sampled_from(ORDINARY), st.sampled_from(ORDINARY)),
    upper=st.booleans(),
)
def test_nothing_that_speaks_of_a_failure_passes(tmp_path_factory, fault, ordinary, upper) -> None:
    def verdict(case: str, suite: str, element: str) -> Verdict:
        if upper and "=" in case:
            case = case.split("=")[0].upper() + "=" + case.split("=", 1)[1].upper()
        text = f"<testsuite {suite}>{element}<testcase {case}/></testsuite>"
        return result_of(tmp_path_factory.mktemp("c"), text).verdict

    assert verdict(*fault) in {Verdict.FAILED, Verdict.ERRORED}
    assert verdict(ordinary[0], ordinary[1].replace("executed", "x"), "") is Verdict.PASSED


@pytest.mark.parametrize("of", ["suite", "case"])
@pytest.mark.parametrize(
    ("attribute", "passes"),
    [
        *((name, False) for name in ('numFailures="1"', 'timeouts="1"', 'crashes="1"')),
        *((name, False) for name in ('incomplete="true"', 'passed="0"', 'passed="false"')),
        *((name, False) for name in ('timed_out="true"', 'verdict="x"', 'conclusion="failure"')),
        *((name, True) for name in ('numFailures="0"', 'timeouts=""', 'passed="1"')),
        *((name, True) for name in ('verdict="passed"', 'timestamp="2026-01-01T00:00:00"')),
    ],
)
def test_no_attribute_that_may_speak_of_a_failure_is_ignored(
    tmp_path: Path, of: str, attribute: str, passes: bool
) -> None:
    suite, case = (attribute, "") if of == "suite" else ("", attribute)
    text = f'<testsuite tests="1" {suite}><testcase name="a" {case}/></testsuite>'
    assert (result_of(tmp_path, text).verdict is Verdict.PASSED) == passes


@pytest.mark.parametrize("place", ["properties", "system-err", "testcase"])
def test_only_cases_of_a_suite_count(tmp_path: Path, place: str) -> None:
    text = f'<testsuite tests="1"><{place}><testcase name="a"/></{place}></testsuite>'
    assert result_of(tmp_path, text).verdict is Verdict.ERRORED


def test_a_total_is_a_number_of_tests(tmp_path: Path) -> None:
    text = '<testsuite total="5"><testcase name="a"/></testsuite>'
    assert "a suite of 5 tests has 1 of them" in result_of(tmp_path, text).reason
