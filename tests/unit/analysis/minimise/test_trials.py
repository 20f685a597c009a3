"""Whether parameters still fail, by the verdicts of their runs."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.campaigns.described import RECORD

from robovast.analysis.minimise.trials import Judged, TrialOutcome, judge
from robovast.base.sequential import SequentialTest
from robovast.campaign.verdict import Verdict

TEST = SequentialTest(good=0.1, bad=0.5, error=0.1, most=20)
CAUSE = "collision at 1.5"
RUNS = {
    "C": (Verdict.FAILED, "collision at -3"),
    "t": (Verdict.FAILED, "stuck"),
    "?": (Verdict.FAILED, "run_process: bash drive.sh failed with 1"),
    "p": (Verdict.PASSED, ""),
    "e": (Verdict.ERRORED, "no test.xml"),
}


def judged(runs: str) -> Judged:
    records = [
        replace(RECORD, run=number, verdict=RUNS[run][0], reason=RUNS[run][1])
        for number, run in enumerate(runs)
    ]
    return judge(TEST, CAUSE, records)


@pytest.mark.parametrize(
    ("runs", "outcome", "counted", "failed", "example"),
    [
        ("CC", TrialOutcome.FAILS, 2, 2, 0),
        ("??", TrialOutcome.FAILS, 2, 2, 0),
        ("eCtpCCC", TrialOutcome.FAILS, 6, 3, 1),
        ("pppp", TrialOutcome.FADES, 4, 0, None),
        ("ppppCC", TrialOutcome.FADES, 4, 0, None),
        ("tttp", TrialOutcome.FAILS_OTHERWISE, 4, 0, 0),
        ("ee", TrialOutcome.ERRORED, 2, 0, 0),
        ("pCpp" * 5, TrialOutcome.UNDECIDED, 20, 5, 1),
    ],
)
def test_the_failure_is_told_from_others_by_the_first_runs_that_suffice(
    runs: str, outcome: TrialOutcome, counted: int, failed: int, example: int | None
) -> None:
    found = judged(runs)
    assert (found.outcome, found.runs, found.failed) == (outcome, counted, failed)
    assert (found.example.run if found.example else None) == example
    assert not found.further


def test_runs_are_needed_until_it_is_decided() -> None:
    assert [judged(runs).further for runs in ("", "C", "e", "pp", "Cp")] == [2, 1, 2, 2, 1]
