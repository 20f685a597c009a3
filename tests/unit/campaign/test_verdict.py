"""test.xml decides; what cannot be read is an error of the run, never of the reader."""

import os
import resource
from pathlib import Path

import pytest

from robovast.campaign.records import Circumstances, EndedRun, make_record
from robovast.campaign.verdict import Verdict, read_test_result
from robovast.model.expansion import Variant
from robovast.model.plan import PackStart, Run

SUITE = '<testsuite errors="{e}" failures="{f}" tests="1" time="1.5">{case}</testsuite>'
START = '<property name="start_time" value="1772634122.5"/>'


def result_of(folder: Path, text: str):
    (folder / "test.xml").write_text(text)
    return read_test_result(folder)


def test_no_failure_is_passed_with_its_times(tmp_path: Path) -> None:
    case = f'<testcase name="a"><properties>{START}</properties></testcase>'
    result = result_of(tmp_path, SUITE.format(e=0, f=0, case=case))
    assert result.verdict is Verdict.PASSED
    assert (result.started_at, result.duration, result.reason) == (1772634122.5, 1.5, "")


@pytest.mark.parametrize(("errors", "failures"), [(1, 0), (0, 2)])
def test_a_failure_or_error_is_failed(tmp_path: Path, errors: int, failures: int) -> None:
    case = '<testcase><failure message="too slow">goal missed by 2 m\nmore</failure></testcase>'
    result = result_of(tmp_path, SUITE.format(e=errors, f=failures, case=case))
    assert (result.verdict, result.reason) == (Verdict.FAILED, "too slow: goal missed by 2 m")


def test_a_drawn_tree_is_no_reason(tmp_path: Path) -> None:
    case = '<testcase><failure message="execution failed.">-^- drive [x]</failure></testcase>'
    assert result_of(tmp_path, SUITE.format(e=0, f=1, case=case)).reason == "the scenario failed"


def test_the_behaviour_that_failed_says_why(tmp_path: Path) -> None:
    tree = "-^- test [✕]\n    {-} serial [✕]\n        --&gt; run [✕] -- sim failed with 3"
    case = f'<testcase><failure message="execution failed.">{tree}</failure></testcase>'
    reason = result_of(tmp_path, SUITE.format(e=0, f=1, case=case)).reason
    assert reason == "run: sim failed with 3"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<testsuite failures='0'", "not valid"),
        ("", "not valid"),
        ("<testsuite failures='many'/>", "not valid"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><testsuite failures="0"/>', "entities"),
    ],
)
def test_what_cannot_be_read_is_errored(tmp_path: Path, text: str, reason: str) -> None:
    result = result_of(tmp_path, text)
    assert result.verdict is Verdict.ERRORED
    assert reason in result.reason


def test_a_missing_file_is_errored(tmp_path: Path) -> None:
    result = read_test_result(tmp_path)
    assert (result.verdict, result.reason) == (Verdict.ERRORED, "the run wrote no test.xml")


def report(*suites: str, **attributes: int) -> str:
    counters = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    return f"<testsuites {counters}>{''.join(suites)}</testsuites>"


GOOD = '<testsuite errors="0" failures="0" tests="1" time="2"><testcase name="a"/></testsuite>'


@pytest.mark.parametrize(
    "text",
    [
        report(GOOD, SUITE.format(e=0, f=1, case="<testcase/>")),
        report(GOOD, GOOD, failures=1),
        report(GOOD, f"<testsuite>{SUITE.format(e=1, f=0, case='<testcase/>')}</testsuite>"),
        SUITE.format(e=0, f=0, case="<testcase><failure/></testcase>"),
        SUITE.format(e=0, f=0, case="<testcase/><testcase><error/></testcase>"),
        SUITE.format(e=0, f=0, case="<error/><testcase/>"),
        '<testsuite xmlns="https://junit.org"><testcase><failure/></testcase></testsuite>',
        "<TestSuite><TestCase><Failure/></TestCase></TestSuite>",
        '<a:testsuite xmlns:a="urn:a"><a:testcase><a:ERROR/></a:testcase></a:testsuite>',
        '<testsuite Failures="1"><testcase/></testsuite>',
        '<testsuite><testcase status="fail"/></testsuite>',
        '<testsuite><testcase result="Failed"/><testcase/></testsuite>',
        "<testsuite><testcase><rerunFailure/></testcase></testsuite>",
        "<testsuite><testcase><flakyFailure/></testcase></testsuite>",
        "<testsuite><testcase><flakyError/></testcase></testsuite>",
        '<testsuite flakes="1"><testcase/></testsuite>',
        '<testsuite failed="1"><testcase/></testsuite>',
        '<testsuite status="failed"><testcase/></testsuite>',
        '<testsuite failures="1" FAILURES="0"><testcase/></testsuite>',
        '<testsuite><testcase status="fail" Status="passed"/></testsuite>',
        '<testsuite xmlns:a="urn:a"><testcase status="fail" a:status="passed"/></testsuite>',
    ],
)
def test_whatever_failed_anywhere_is_failed(tmp_path: Path, text: str) -> None:
    assert result_of(tmp_path, text).verdict is Verdict.FAILED


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<a/>", "not a JUnit report: its outermost element is `a`"),
        ("<html><body><p>404</p></body></html>", "outermost element is `html`"),
        ("<!DOCTYPE html><html/>", "not a JUnit report"),
        ("<testcase/>", "not a JUnit report"),
        ("<testsuites/>", "no test case"),
        ("<testsuites><testcase/></testsuites>", "no test case"),
        ('<testsuite errors="0" failures="0" tests="0"/>', "no test case"),
        (SUITE.format(e=0, f=0, case="<testcase><skipped/></testcase>"), "were skipped"),
        ('<testsuite><testcase status="notrun"/></testsuite>', "were skipped"),
        ('<testsuite><testcase status="run" result="suppressed"/></testsuite>', "were skipped"),
        ('<testsuite><testcase result="skipped"/></testsuite>', "were skipped"),
        ("<testsuite><testcase><disabled/></testcase></testsuite>", "were skipped"),
        ("<testsuite><testcase><Skipped/></testcase></testsuite>", "were skipped"),
        ('<testsuite tests="2" disabled="2"><testcase/><testcase/></testsuite>', "were skipped"),
        ('<testsuites disabled="1"><testsuite><testcase/></testsuite></testsuites>', "skipped"),
        ('<testsuite tests="1" skip="1"><testcase/></testsuite>', "were skipped"),
        ('<testsuite disabled="-1"><testcase/></testsuite>', "`disabled` is -1"),
        (
            '<testsuite><testcase/><testcase status="crashed"/></testsuite>',
            "the status `crashed`, which is not known",
        ),
        ('<testsuite tests="3"><testcase/></testsuite>', "a suite of 3 tests has 1 of them"),
        ('<testsuite failures="-1" errors="1"><testcase/></testsuite>', "`failures` is -1"),
    ],
)
def test_what_shows_no_case_that_passed_is_errored(tmp_path: Path, text: str, reason: str) -> None:
    result = result_of(tmp_path, text)
    assert result.verdict is Verdict.ERRORED
    assert reason in result.reason


def test_cases_of_all_suites_pass_and_take_their_time(tmp_path: Path) -> None:
    mixed = "<testcase/><testcase><skipped/></testcase>"
    result = result_of(tmp_path, report(GOOD, SUITE.format(e=0, f=0, case=mixed)))
    assert (result.verdict, result.duration) == (Verdict.PASSED, 3.5)


@pytest.mark.parametrize(
    "text",
    [
        # GoogleTest, with one test that is disabled
        '<testsuites tests="2" failures="0" disabled="1" errors="0"><testsuite tests="2" '
        'failures="0" disabled="1" skipped="0" errors="0"><testcase name="a" status="run" '
        'result="completed"/><testcase name="b" status="notrun" result="suppressed"/></testsuite>'
        "</testsuites>",
        # pytest
        '<testsuites name="pytest tests"><testsuite errors="0" failures="0" skipped="1" tests="2">'
        '<testcase/><testcase><skipped type="pytest.skip" message="why"/></testcase></testsuite>'
        "</testsuites>",
        # CTest
        '<testsuite tests="1" failures="0" disabled="0" skipped="0"><testcase status="run">'
        "<system-out>it said &lt;failure/&gt;</system-out></testcase></testsuite>",
        # Surefire
        '<testsuite xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" tests="1" errors="0" '
        'skipped="0" failures="0" flakes="0"><properties/><testcase/></testsuite>',
        "<testsuite><testcase><skipped/><skipped/></testcase><testcase/></testsuite>",
    ],
)
def test_reports_of_others_pass_when_something_ran_and_all_that_did_passed(
    tmp_path: Path, text: str
) -> None:
    assert result_of(tmp_path, text).verdict is Verdict.PASSED


@pytest.mark.parametrize("time", ["nan", "inf", "-inf", "-1", "1e300", "9" * 5000, "soon", ""])
def test_times_that_make_no_sense_are_no_times(tmp_path: Path, time: str) -> None:
    start = f'<property name="start_time" value="{time}"/>'
    suite = f'<testsuite time="{time}"><testcase>{start}</testcase></testsuite>'
    result = result_of(tmp_path, suite)
    assert result.verdict is Verdict.PASSED
    assert (result.started_at, result.duration) == (None, None)


def test_times_that_are_large_can_be_added(tmp_path: Path) -> None:
    start = '<property name="start_time" value="8589934591"/>'
    suite = f'<testsuite time="8589934591"><testcase>{start}</testcase></testsuite>'
    circumstances = Circumstances("c", 1, "job-0", "docker", "i", "", "h")
    run = Run(0, Variant("v", "v", {}), 0)
    result = result_of(tmp_path, suite)
    ended = EndedRun(PackStart(0, (run,)), run, tmp_path, result, (0.0, 1.0), 0)
    record = make_record(ended, circumstances)
    assert record.finished_at.startswith("2514-")


def test_a_pipe_or_a_link_is_no_result(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    os.mkfifo(tmp_path / "run" / "test.xml")
    assert "is not a regular file" in read_test_result(tmp_path / "run").reason
    (tmp_path / "test.xml").write_text(GOOD)
    (tmp_path / "link").symlink_to(tmp_path)
    assert read_test_result(tmp_path / "link").verdict is Verdict.ERRORED


def test_a_gigabyte_of_nothing_is_told_and_not_read(tmp_path: Path) -> None:
    with (tmp_path / "test.xml").open("wb") as file:
        file.truncate(1 << 30)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result = read_test_result(tmp_path)
    assert (result.verdict, "is larger than" in result.reason) == (Verdict.ERRORED, True)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 32 << 10, "KiB"


def test_a_scenario_that_cannot_be_parsed_was_not_tried(tmp_path: Path) -> None:
    case = '<testcase><failure message="parsing failed">gain integer expected</failure></testcase>'
    result = result_of(tmp_path, SUITE.format(e=0, f=1, case=case))
    assert result.verdict is Verdict.ERRORED
    assert result.reason == "the scenario cannot be parsed: gain integer expected"
