"""How a run's process ended decides where test.xml cannot."""

import signal
from pathlib import Path

from robovast.execution.judge import Ending, judge
from robovast.results.verdict import TestResult, Verdict

PASSED = TestResult(Verdict.PASSED, "", 1.0, 2.0)
FAILED = TestResult(Verdict.FAILED, "no", 1.0, 2.0)
NOTHING = TestResult(Verdict.ERRORED, "the run wrote no test.xml")


def judged(result: TestResult, ending: Ending, tmp_path: Path, log: str = "") -> TestResult:
    path = tmp_path / "system.log"
    path.write_text(log)
    return judge(result, ending, 30, path)


def test_test_xml_counts_whatever_the_exit_code(tmp_path: Path) -> None:
    assert judged(PASSED, Ending(1), tmp_path) == PASSED
    assert judged(FAILED, Ending(0), tmp_path) == FAILED


def test_a_timeout_is_errored_although_scenario_execution_wrote_a_failure(tmp_path: Path) -> None:
    result = judged(FAILED, Ending(1, timed_out=True), tmp_path)
    assert result.verdict is Verdict.ERRORED
    assert "30 s" in result.reason
    assert "execution.timeout" in result.reason


def test_an_interrupted_run_counts_only_when_it_had_passed(tmp_path: Path) -> None:
    stopped = Ending(1, interrupted=True)
    assert judged(FAILED, stopped, tmp_path).verdict is Verdict.INTERRUPTED
    assert judged(NOTHING, stopped, tmp_path).verdict is Verdict.INTERRUPTED
    assert judged(PASSED, stopped, tmp_path).verdict is Verdict.PASSED


def test_without_a_verdict_the_reason_names_code_meaning_and_last_words(tmp_path: Path) -> None:
    reason = judged(NOTHING, Ending(70), tmp_path, "a\nno such robot\n\n").reason
    assert "exit code 70: the pre command failed" in reason
    assert reason.endswith("its log ends: no such robot")


def test_a_signal_is_named_as_a_shell_or_python_reports_it(tmp_path: Path) -> None:
    for code in (137, -signal.SIGKILL):
        assert "SIGKILL (out of memory?)" in judged(NOTHING, Ending(code), tmp_path).reason
    assert "SIGSEGV" in judged(NOTHING, Ending(139), tmp_path).reason


def test_a_missing_log_is_no_fault(tmp_path: Path) -> None:
    result = judge(NOTHING, Ending(1), None, tmp_path / "none.log")
    assert result.reason == "the run wrote no test.xml; exit code 1"
