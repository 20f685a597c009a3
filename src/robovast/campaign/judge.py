"""The final verdict of a run: from test.xml, unless the run was ended from outside.

Two verdicts are made elsewhere, of runs without any result: of one that pods began
in vain too often (`agent/claims.py`), and at the end of one that nobody stored (`agent/finish.py`).
"""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace
from enum import IntEnum

from robovast.campaign.verdict import TestResult, Verdict


@dataclass(frozen=True)
class Ending:
    """How the process that executed a run ended."""

    exit_code: int | None
    """Exit code; None while the process still runs (for earlier runs of a pack)."""
    timed_out: bool = False
    interrupted: bool = False
    container_killed: bool = False
    """True when its whole container was killed; the reason is not visible from inside."""
    lacked_memory: bool = False
    """True when the kernel killed a process of the job for lack of memory."""

    @property
    def from_outside(self) -> bool:
        """True when the job was stopped, so that the result of its current run is unreliable."""
        return self.timed_out or self.interrupted


def judge(
    result: TestResult, ending: Ending, timeout: int | None, log: bytes, run: str = ""
) -> TestResult:
    """The final result of a run.

    Args:
        result: the result in test.xml.
        ending: how the process ended.
        timeout: the document's limit [s].
        log: the end of the job's log, which says why the run did not pass.
        run: `<variant>/<number>`, by which the log of a pack names the run.
    """
    if ending.timed_out:
        reason = f"stopped after {timeout} s, the limit of execution.timeout"
        return TestResult(Verdict.ERRORED, reason, result.started_at, None)
    if ending.interrupted and result.verdict is not Verdict.PASSED:
        return TestResult(Verdict.INTERRUPTED, "stopped by the user", result.started_at, None)
    return (
        result if result.verdict is Verdict.PASSED else _with_explanation(result, ending, log, run)
    )


def _with_explanation(result: TestResult, ending: Ending, log: bytes, run: str) -> TestResult:
    """The result of a run that did not pass, with its reason; see `judge`."""
    from robovast.campaign.reasons import (  # which a run that passed does without
        error_of_contract,
        explain_error,
        explain_failure,
        lines_of_run,
    )

    if ending.lacked_memory:
        result = replace(result, reason=f"{result.reason}; {_LACKED_MEMORY}", explained=True)
    if result.verdict is Verdict.FAILED:
        lines = lines_of_run(log, result.started_at, run)
        why = explain_failure(result.reason, result.action, result.explained, lines)
        return replace(result, reason=why)
    if result.verdict is not Verdict.ERRORED or ending.exit_code is None:
        return result
    lines = lines_of_run(log, None, run)
    stated = error_of_contract(lines)
    known = ending.lacked_memory
    explained = (
        CONTAINER_KILLED if ending.container_killed else _explain(ending.exit_code, stated, known)
    )
    why = explain_error(f"{result.reason}; {explained}", lines)
    return TestResult(Verdict.ERRORED, why)


CONTAINER_KILLED = "its container was ended by SIGKILL (out of memory?)"
OUT_OF_MEMORY = "its container was ended by SIGKILL: out of memory"
_LACKED_MEMORY = "the kernel has killed a process of its job for lack of memory"


class EntrypointExit(IntEnum):
    """What the run contract's scripts end with when they are at fault, or their image."""

    LACKING = 69
    COMMAND = 70
    OUTPUT = 73


_MEANINGS = {
    EntrypointExit.LACKING: "the image lacks a program that the container interface requires",
    EntrypointExit.COMMAND: "the pre command failed, or the post command cannot be run",
    EntrypointExit.OUTPUT: "an output folder cannot be written",
    126: "a program could not be run",
    127: "a program was not found",
}


def _explain(code: int, stated: str, lacked_memory: bool) -> str:
    number = -code if code < 0 else code - 128 if code > 128 else 0
    if number in {item.value for item in signal.Signals}:
        name = signal.Signals(number).name
        guess = " (out of memory?)" if name == "SIGKILL" and not lacked_memory else ""
        return f"it was ended by {name}{guess}"
    meaning = (stated if code in set(EntrypointExit) else "") or _MEANINGS.get(code)
    return f"exit code {code}" + (f": {meaning}" if meaning else "")
