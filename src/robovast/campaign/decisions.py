"""When the runs of a configuration are enough, by a sequential test of their verdicts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robovast.base.sequential import Decision, SequentialTest, State
from robovast.campaign.planned_runs import PlannedRuns, planned_runs
from robovast.campaign.verdict import Verdict

DECIDE = "decide"
"""Key of the test in `_execution/execution.yaml`; `runs` there are each configuration's most."""

DECISIONS_LIMIT = 250
"""Longest text about decisions, for people [characters]."""

_EVIDENCE = {Verdict.PASSED: False, Verdict.FAILED: True}
"""Whether a run failed; an errored one says nothing of the robot."""


@dataclass(frozen=True)
class CampaignTest:
    """What ends the runs of the configurations of a campaign."""

    rule: SequentialTest
    """Of a configuration that was given no more runs than the others."""
    planned: PlannedRuns

    def of(self, variant: str) -> SequentialTest:
        """The test of a configuration."""
        return self.rule.at_most(self.planned.of(variant))


def decide(test: SequentialTest, verdicts: Mapping[int, Verdict]) -> Decision:
    """The decision about a configuration: a function of its verdicts by run number alone.

    Args:
        test: of the campaign.
        verdicts: of its runs by number; those after the first that is missing do not count yet.
    """
    return test.decide(_EVIDENCE.get(verdict) for verdict in _known(verdicts))


def runs_to_start(decision: Decision, left: Sequence[int], most: int) -> list[int]:
    """The runs of a configuration to start next, by number, if it is not decided.

    Args:
        decision: about the configuration so far.
        left: numbers of the runs that can be started, in order.
        most: how many may be started together.

    Returns:
        Those that are needed whatever becomes of runs under way, else one that may be.
    """
    if decision.is_over:
        return []
    certain = [number for number in left if number < decision.runs + decision.further]
    return certain[:most] or list(left[:1])


def _known(verdicts: Mapping[int, Verdict]) -> Iterator[Verdict]:
    for number in count():
        verdict = verdicts.get(number, Verdict.INTERRUPTED)
        if verdict is Verdict.INTERRUPTED:
            return
        yield verdict


class _Recorded(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, defer_build=True)

    min: int = Field(1, ge=1)
    good: float = Field(gt=0, lt=1)
    bad: float = Field(gt=0, lt=1)
    error: float = Field(gt=0, lt=0.5)


def test_record(test: SequentialTest) -> dict[str, float]:
    """The test as `_execution/execution.yaml` has it."""
    return {"min": test.least, "good": test.good, "bad": test.bad, "error": test.error}


def recorded_test(execution: Mapping[str, Any]) -> CampaignTest | None:
    """The test in the content of `_execution/execution.yaml`; None without one that is valid."""
    planned = planned_runs(execution)
    if DECIDE not in execution or not planned.each:
        return None
    try:
        found = _Recorded.model_validate(execution[DECIDE])
    except ValidationError:
        return None
    if found.good >= found.bad:
        return None
    rule = SequentialTest(found.good, found.bad, found.error, found.min, planned.each)
    return CampaignTest(rule, planned)


def describe_decision(decision: Decision) -> str:
    """Describe a decision: `passing after 18`, `inconclusive at 50`.

    An open decision is `inconclusive after 7 so far`.
    """
    if not decision.is_over:
        return f"{State.UNDECIDED.word} after {decision.runs} so far"
    word = "at" if decision.state is State.UNDECIDED else "after"
    return f"{decision.state.word} {word} {decision.runs}"


def runs_needed(decisions: Collection[Decision], most: int) -> str:
    """`70 passing after 18-41, 30 failing after 3; 1,740 of 5,000 runs needed`.

    Args:
        decisions: about all configurations.
        most: how many runs these could have had.
    """
    needed = sum(decision.runs for decision in decisions)
    return f"{summed_up(decisions)}; {needed:,} of {most:,} runs needed"


def summed_up(decisions: Iterable[Decision]) -> str:
    """Count decisions: `70 passing after 18-41, 10 failing after 3, 20 inconclusive at 50`."""
    parts = []
    listed = list(decisions)
    for state, word in ((State.SOUND, "after"), (State.BROKEN, "after"), (State.UNDECIDED, "at")):
        runs = [one.runs for one in listed if one.state is state and one.is_over]
        if runs:
            between = f"{min(runs)}" if min(runs) == max(runs) else f"{min(runs)}-{max(runs)}"
            parts.append(f"{len(runs)} {state.word} {word} {between}")
    still = sum(not one.is_over for one in listed)
    return ", ".join([*parts, *([f"{still} not decided yet"] if still else [])])
