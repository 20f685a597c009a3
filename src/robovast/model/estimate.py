"""How long a campaign takes, with the interval that holds for nine of ten. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log, sqrt

from robovast.model.document.execution import Execution
from robovast.model.quantities import cpus

_Z = 1.644854
"""Of the normal distribution: nine of ten values are within this many deviations."""

SPREAD = 0.3
"""How much two campaigns of one document differ (deviation of the logarithm) before more is known:
it counts as much as two campaigns that were seen."""
_KNOWN = 2

RUN_SPREAD = 1.0
"""How much two runs of a campaign differ at most, as exponentially distributed ones do."""


@dataclass(frozen=True)
class Spent:
    """What an earlier campaign took."""

    runs: int
    workers: int
    """How many runs it executed side by side at most."""
    seconds: float


@dataclass(frozen=True)
class Forecast:
    """How long something takes [s]; nine of ten times it takes from `least` to `most`."""

    seconds: float
    least: float
    most: float


def forecast(earlier: Sequence[Spent], runs: int, workers: int) -> Forecast | None:
    """How long a campaign takes; None if nothing is known.

    Args:
        earlier: campaigns like it that have ended.
        runs: how many it has.
        workers: how many are executed side by side at most.
    """
    times = [log(one.seconds / _turns(one.runs, one.workers)) for one in earlier if one.seconds > 0]
    if not times or runs < 1:
        return None
    mean = sum(times) / len(times)
    freedom = _KNOWN + len(times) - 1
    squares = _KNOWN * SPREAD**2 + sum((time - mean) ** 2 for time in times)
    half = _student(freedom) * sqrt(squares / freedom * (1 + 1 / len(times)))
    seconds = exp(mean) * _turns(runs, workers)
    return Forecast(seconds, seconds * exp(-half), seconds * exp(half))


def _turns(runs: int, workers: int) -> int:
    """How often a worker has a run."""
    return max(1, -(-runs // max(1, workers)))


def remaining(done: int, left: int, workers: int, seconds: float) -> Forecast | None:
    """How long a campaign goes on; None before a run has ended.

    Args:
        done: runs that have ended.
        left: the others.
        workers: how many are executed side by side at most.
        seconds: since the first one began.
    """
    if not done or seconds <= 0:
        return None
    if not left:
        return Forecast(0.0, 0.0, 0.0)
    last = min(left, workers)  # these have begun, and the longest of them ends the campaign
    one = seconds / done * min(workers, done + last)
    longest = one * (1 + sum(1 / number for number in range(1, last + 1)))
    bulk, half = (left - last) * seconds / done, _Z * RUN_SPREAD * sqrt(1 / done + 1 / left)
    return Forecast(bulk + longest / 3, bulk * exp(-half) + one / 20, bulk * exp(half) + longest)


def cores_of(execution: Execution, context: str) -> float:
    """CPUs of the containers of a run, as far as a document limits them.

    Raises:
        InputError: they are not for this cluster.
    """
    sections = [execution.resources, *(one.resources for one in execution.secondary_containers)]
    return sum(cpus(one.cpu, "execution.resources.cpu", context) or 0.0 for one in sections)


def _student(freedom: int) -> float:
    """Student's t instead of `_Z`, by the first terms of its expansion (2 or more degrees)."""
    z, n = _Z, freedom
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / n + second / n**2 + third / n**3
