"""How long a campaign takes, with the interval that holds for nine of ten. Pure functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, exp, log, sqrt

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


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is."""

    done: int
    """Runs that have ended."""
    left: int
    """The others."""
    begun: float
    """How many of these are in packs that are being executed."""
    workers: int
    """How many packs are executed side by side at most."""
    seconds: float
    """Since the first one began."""
    pack: float = 1.0
    """Runs of a pack."""
    starts: float = 0.0
    """What starts took each worker that further runs will not cost [s]: early packs are small where
    they are measured."""


def remaining(so_far: CampaignProgress) -> Forecast | None:
    """How long a campaign goes on; None before a run has ended.

    Nobody knows how much of the packs that are being executed is done: nothing of them, as where
    all packs take as long, and have just begun; or all, as where they are about to end. What it
    takes if either is so are the bounds, and half of it is the estimate.
    """
    done, left, seconds = so_far.done, so_far.left, so_far.seconds
    if not done or seconds <= 0:
        return None
    if not left:
        return Forecast(0.0, 0.0, 0.0)
    begun, effective = min(so_far.begun, left), seconds - so_far.starts
    half, whole = (effective * (left - part) / (done + part) for part in (begun / 2, begun))
    workers = min(so_far.workers, (done + begun) / so_far.pack)
    one = workers * effective * so_far.pack / (done + begun / 2)  # what a pack takes
    last = max(1, min(ceil(workers), ceil(left / so_far.pack)))  # the longest of these ends it
    harmonic = sum(1 / number for number in range(1, last + 1))
    longest = one * (1 + RUN_SPREAD * (harmonic - 1) / sqrt(so_far.pack))
    spread = exp(_Z * RUN_SPREAD * sqrt(1 / done + 1 / left))
    return Forecast(half + one / 2, whole / spread, seconds * left / done * spread + longest)


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
