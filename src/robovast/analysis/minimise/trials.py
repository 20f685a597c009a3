"""Whether milder parameters still fail, by a sequential test of their runs. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from robovast.base.sequential import SequentialTest, State
from robovast.campaign.failure_groups import cause_key
from robovast.campaign.reasons import says_only_that_it_failed
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict

_ERRORED_RUNS = 2
"""Parameters whose first runs errored are given up: more runs would hardly have a verdict."""


class TrialOutcome(StrEnum):
    """What the runs of some parameters show."""

    FAILS = "still fails"
    """For the cause of the run that is minimised."""
    FAILS_OTHERWISE = "fails otherwise"
    FADES = "hardly fails"
    ERRORED = "errored"
    UNDECIDED = "undecided"
    """Neither often enough nor seldom enough."""


@dataclass(frozen=True)
class Judged:
    """The runs of some parameters so far."""

    outcome: TrialOutcome
    runs: int
    """Runs that the judgement is based on."""
    failed: int
    """How many of these runs failed for the same cause."""
    further: int
    """How many more runs are needed, whatever their results; 0 when it is decided."""
    example: RunRecord | None
    """The first one that failed for the same cause, else the first that did not pass."""

    @property
    def reason(self) -> str:
        """Why the example did not pass."""
        return self.example.reason if self.example else ""


def judge(test: SequentialTest, cause: str, records: Sequence[RunRecord]) -> Judged:
    """What runs show: a function of their verdicts in the order of their numbers alone.

    A run that fails for another cause does not show the failure; an errored one shows nothing.

    Args:
        test: tells a failure that is still there from one that is not.
        cause: reason of the run that is minimised.
        records: from the first run on, without a gap.
    """
    first = [record.verdict for record in records[:_ERRORED_RUNS]]
    if first == [Verdict.ERRORED] * _ERRORED_RUNS:
        return Judged(TrialOutcome.ERRORED, len(first), 0, 0, records[0])
    decision = test.decide(_shows(record, cause) for record in records)
    counted = records[: decision.runs]
    alike = [record for record in counted if _shows(record, cause)]
    bad = [record for record in counted if record.verdict is not Verdict.PASSED]
    outcome = _OUTCOMES[decision.state]
    if outcome is TrialOutcome.FADES and len(bad) - len(alike) > len(counted) / 2:
        outcome = TrialOutcome.FAILS_OTHERWISE
    example = next(iter([*alike, *bad]), None)
    return Judged(outcome, decision.runs, len(alike), decision.further, example)


_OUTCOMES = {
    State.BROKEN: TrialOutcome.FAILS,
    State.SOUND: TrialOutcome.FADES,
    State.UNDECIDED: TrialOutcome.UNDECIDED,
}


def _shows(record: RunRecord, cause: str) -> bool | None:
    """Whether a run failed for the cause; None if it shows nothing."""
    if record.verdict is Verdict.FAILED:
        return _is_same(record.reason, cause)
    return False if record.verdict is Verdict.PASSED else None


def _is_same(reason: str, cause: str) -> bool:
    """Whether two failures may have the same cause, judged by their reasons."""
    known = not any(map(says_only_that_it_failed, (reason, cause)))
    return cause_key(reason) == cause_key(cause) or not known
