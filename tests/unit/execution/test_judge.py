"""How a run's process ended decides where test.xml cannot."""

import signal

from robovast.campaign.judge import Ending, judge
from robovast.campaign.verdict import TestResult, Verdict

PASSED = TestResult(Verdict.PASSED, "", 1.0, 2.0)
FAILED = TestResult(Verdict.FAILED, "no", 1.0, 2.0)
NOTHING = TestResult(Verdict.ERRORED, "the run wrote no test.xml")


def judged(result: TestResult, ending: Ending, log: str = "") -> TestResult:
    return judge(result, ending, 30, log.encode())


def test_test_xml_counts_whatever_the_exit_code() -> None:
    assert judged(PASSED, Ending(1)) == PASSED
    assert judged(FAILED, Ending(0)) == FAILED


def test_a_timeout_is_errored_although_scenario_execution_wrote_a_failure() -> None:
    result = judged(FAILED, Ending(1, timed_out=True))
    assert result.verdict is Verdict.ERRORED
    assert "30 s" in result.reason
    assert "execution.timeout" in result.reason


def test_an_interrupted_run_counts_only_when_it_had_passed() -> None:
    stopped = Ending(1, interrupted=True)
    assert judged(FAILED, stopped).verdict is Verdict.INTERRUPTED
    assert judged(NOTHING, stopped).verdict is Verdict.INTERRUPTED
    assert judged(PASSED, stopped).verdict is Verdict.PASSED


def test_without_a_verdict_the_reason_names_code_meaning_and_last_words() -> None:
    reason = judged(NOTHING, Ending(70), "a\nno such robot\n\n").reason
    assert "exit code 70: the pre command failed" in reason
    assert reason.endswith("its log ends: no such robot")


def test_what_the_contract_says_of_its_own_end_tells_more_than_its_code() -> None:
    log = "no licence\n[robovast] error: the pre command /config/files/pre.sh failed with code 3\n"
    reason = judged(NOTHING, Ending(70), log).reason
    assert "; exit code 70: the pre command pre.sh failed with code 3; " in reason
    assert reason.endswith("its log ends: no licence")
    assert "pre.sh" not in judged(NOTHING, Ending(1), log).reason


def test_a_signal_is_named_as_a_shell_or_python_reports_it() -> None:
    for code in (137, -signal.SIGKILL):
        assert "SIGKILL (out of memory?)" in judged(NOTHING, Ending(code)).reason
    assert "SIGSEGV" in judged(NOTHING, Ending(139)).reason


def test_a_missing_log_is_no_fault() -> None:
    result = judge(NOTHING, Ending(1), None, b"")
    assert result.reason == "the run wrote no test.xml; exit code 1"


def test_lack_of_memory_is_told_as_far_as_it_is_known() -> None:
    gone = judged(NOTHING, Ending(137, container_killed=True)).reason
    assert "its container was ended by SIGKILL (out of memory?)" in gone
    seen = judged(NOTHING, Ending(1, lacked_memory=True)).reason
    assert "the kernel has killed a process of its job for lack of memory; exit code 1" in seen
    assert "lack of memory" in judged(FAILED, Ending(1, lacked_memory=True)).reason
    assert judged(PASSED, Ending(0, lacked_memory=True)) == PASSED
