"""test.xml decides; what cannot be read is an error of the run, never of the reader."""

from pathlib import Path

import pytest

from robovast.results.verdict import Verdict, read_test_result

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
    assert result_of(tmp_path, SUITE.format(e=0, f=1, case=case)).reason == "execution failed."


def test_the_behaviour_that_failed_says_why(tmp_path: Path) -> None:
    tree = "-^- test [✕]\n    {-} serial [✕]\n        --&gt; run [✕] -- sim failed with 3"
    case = f'<testcase><failure message="execution failed.">{tree}</failure></testcase>'
    reason = result_of(tmp_path, SUITE.format(e=0, f=1, case=case)).reason
    assert reason == "execution failed.: sim failed with 3"


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
