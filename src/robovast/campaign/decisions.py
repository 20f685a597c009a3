"""When the runs of a configuration are enough, by a sequential test of their verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robovast.base.sequential import Decision, SequentialTest, State
from robovast.campaign.verdict import Verdict

DECIDE = "decide"
"""Key of the test in `_execution/execution.yaml`; `runs` there are each configuration's most."""

_EVIDENCE = {Verdict.PASSED: False, Verdict.FAILED: True}
"""Whether a run failed; an errored one says nothing of the robot."""


def decide(test: SequentialTest, verdicts: Mapping[int, Verdict]) -> Decision:
    """The decision about a configuration: a function of its verdicts by run number alone.

    Args:
        test: of the campaign.
        verdicts: of its runs by number; those after the first that is missing do not count yet.
    """
    return test.decide(_EVIDENCE.get(verdict) for verdict in _known(verdicts))


def _known(verdicts: Mapping[int, Verdict]) -> Iterator[Verdict]:
    for number in count():
        verdict = verdicts.get(number, Verdict.INTERRUPTED)
        if verdict is Verdict.INTERRUPTED:
            return
        yield verdict


class _Recorded(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    min: int = Field(1, ge=1)
    good: float = Field(gt=0, lt=1)
    bad: float = Field(gt=0, lt=1)
    error: float = Field(gt=0, lt=0.5)


def test_record(test: SequentialTest) -> dict[str, float]:
    """The test as `_execution/execution.yaml` has it."""
    return {"min": test.least, "good": test.good, "bad": test.bad, "error": test.error}


def recorded_test(execution: Mapping[str, Any]) -> SequentialTest | None:
    """The test in the content of `_execution/execution.yaml`; None without one that is valid."""
    most = execution.get("runs")
    if DECIDE not in execution or type(most) is not int or most < 1:
        return None
    try:
        found = _Recorded.model_validate(execution[DECIDE])
    except ValidationError:
        return None
    if found.good >= found.bad:
        return None
    return SequentialTest(found.good, found.bad, found.error, found.min, most)


def told(decision: Decision) -> str:
    """`sound after 18`, `undecided at 50`; of one that is not over, `undecided after 7 so far`."""
    if not decision.is_over:
        return f"{State.UNDECIDED} after {decision.runs} so far"
    word = "at" if decision.state is State.UNDECIDED else "after"
    return f"{decision.state} {word} {decision.runs}"


def summed_up(decisions: Iterable[Decision]) -> str:
    """`70 sound after 18-41, 10 broken after 3, 20 undecided at 50` configurations."""
    parts = []
    listed = list(decisions)
    for state, word in ((State.SOUND, "after"), (State.BROKEN, "after"), (State.UNDECIDED, "at")):
        runs = [one.runs for one in listed if one.state is state and one.is_over]
        if runs:
            between = f"{min(runs)}" if min(runs) == max(runs) else f"{min(runs)}-{max(runs)}"
            parts.append(f"{len(runs)} {state} {word} {between}")
    still = sum(not one.is_over for one in listed)
    return ", ".join([*parts, *([f"{still} not decided yet"] if still else [])])
