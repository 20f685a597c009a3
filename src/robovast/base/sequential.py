"""Wald's sequential test: run a configuration until it is classified as passing or failing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from math import ceil, log, log1p

_NEVER = 10**9
"""Runs that nobody waits for."""


class State(StrEnum):
    """Classification of a configuration by its failure rate.

    The values are those of stored files and of JSON outputs, which scripts read.
    """

    BROKEN = "broken"
    UNDECIDED = "undecided"
    SOUND = "sound"

    @property
    def word(self) -> str:
        """The state in texts for people: failing, inconclusive or passing."""
        return _WORDS[self]


_WORDS = {State.BROKEN: "failing", State.UNDECIDED: "inconclusive", State.SOUND: "passing"}


@dataclass(frozen=True, slots=True)
class Decision:
    """What a test says after some runs."""

    state: State
    runs: int
    """Runs that it is based on."""
    further: int
    """Further runs that are needed whatever becomes of them; 0 when the test has ended."""

    @property
    def is_over(self) -> bool:
        """Whether no further run is needed."""
        return not self.further


@dataclass(frozen=True, slots=True)
class SequentialTest:
    """Tells whether runs fail in at most `good` or in at least `bad` of all cases.

    After each run it compares the likelihoods of the two rates and stops when one is more than
    1 / `error` times the other. Under either rate the other's ratio is a martingale (below `good`
    and above `bad` it sinks), so that by Ville's inequality it ever gets so large with a
    probability of at most `error`: the error is kept however late the test may begin to stop, and
    where it is cut off, which only turns decisions into `undecided`. Wald's own limits,
    (1 - error) / error, would be narrower, and keep the sum of both errors only.
    """

    good: float
    """Failure rate up to which a robot is sound."""
    bad: float
    """Failure rate from which on it is broken."""
    error: float
    """Probability of a wrong decision, for a sound robot as for a broken one."""
    least: int = 1
    """Runs before which nothing is decided."""
    most: int | None = None
    """Runs after which it is given up; None: never."""

    def at_most(self, runs: int) -> SequentialTest:
        """The test of a configuration that has so many runs."""
        return replace(self, least=min(self.least, runs), most=runs)

    def decide(self, outcomes: Iterable[bool | None]) -> Decision:
        """The decision by the first runs that suffice, or by all of them.

        Args:
            outcomes: whether each run failed, by run number; None is no evidence.
        """
        runs = failed = passed = 0
        decision = self.after(0, 0, 0)
        for runs, outcome in enumerate(outcomes, 1):
            if decision.is_over:
                break
            failed += outcome is True
            passed += outcome is False
            decision = self.after(runs, failed, passed)
        return decision

    def shortest(self, outcome: bool) -> int:
        """Runs that it takes if all of them end alike: no decision of that kind is quicker."""
        return self._least(outcome, 0.0)

    def after(self, runs: int, failed: int, passed: int) -> Decision:
        """The decision after runs of which so many failed and passed."""
        weight = failed * self._failure - passed * self._success
        if runs >= self.least and abs(weight) >= self._limit:
            return Decision(State.BROKEN if weight > 0 else State.SOUND, runs, 0)
        quickest = min(self._least(True, weight), self._least(False, weight))
        further = max(1, self.least - runs, quickest)
        if self.most is not None:
            further = min(further, self.most - runs)
        return Decision(State.UNDECIDED, runs, further)

    def _least(self, outcome: bool, weight: float) -> int:
        """Runs of one outcome that it takes from a logarithm of the ratio on."""
        step = self._failure if outcome else self._success
        left = self._limit - (weight if outcome else -weight)
        return ceil(min(left / step, _NEVER)) if step > 0 else _NEVER

    @property
    def _limit(self) -> float:
        return -log(self.error)

    @property
    def _failure(self) -> float:
        """What a failure adds to the logarithm of the ratio."""
        return log(self.bad) - log(self.good)

    @property
    def _success(self) -> float:
        """What a success takes off."""
        return log1p(-self.good) - log1p(-self.bad)
