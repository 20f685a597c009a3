"""`runs_per_job: auto`: how many runs share a start, by what starts and runs have taken.

The campaign is cut in rounds, each planned when workers would have nothing to do without it. The
first one measures; each further one takes about half of what is left, so that packs get smaller
towards the end and no worker waits long for the last one (factoring: Hummel, Schonberg and Flynn,
1992). Between that, a pack is no larger than it takes for its start to cost little.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil

SHARE = 0.02
"""Part of a pack's time that its start may take where runs abound: the smaller packs of the
beginning and the end take another such part, so that all starts together stay below 5 %."""

GROWTH = 16
"""By how much packs grow from one round to the next at most: the first runs that end are the
short ones, and say little of the others."""

WAIT = 8
"""How many starts as long as the last packs may take: smaller ones would cost a start more of each
worker, which is longer than any would wait for the others."""

MOST = 10_000
"""Most runs of a pack."""


@dataclass(frozen=True)
class Pace:
    """What was measured."""

    start: float
    """What a start costs beside its runs [s]."""
    run: float
    """What a run takes [s]."""


@dataclass(frozen=True)
class PackSample:
    """One start that has ended."""

    runs: int
    run_seconds: float
    """Time of all its runs together."""
    seconds: float
    """Time of the whole sample."""


def pace_of(samples: Iterable[PackSample]) -> Pace | None:
    """What a start and a run take; None if no run was measured.

    A start that had to wait for an image, say, tells nothing of the others: half of them tell.
    """
    known = [sample for sample in samples if sample.runs > 0]
    if not known:
        return None
    runs = sum(sample.run_seconds for sample in known) / sum(sample.runs for sample in known)
    start = _median(max(0.0, sample.seconds - sample.run_seconds) for sample in known)
    return Pace(start, runs)


def _median(values: Iterable[float]) -> float:
    from statistics import median  # whose import costs more than a document's own checks

    return median(values)


def next_packs(left: int, workers: int, last: int, pace: Pace | None) -> tuple[int, int]:
    """How many runs to cut into packs now, and the size of these.

    Args:
        left: runs that are in no pack yet, at least one.
        workers: how many packs are executed side by side.
        last: size of the packs before; 0 if there are none.
        pace: what was measured of them; None if nothing was.
    """
    if not last or pace is None:
        size = max(1, last)
        return min(left, workers * size), size
    enough = min(MOST, _packs_of(pace.start / SHARE - pace.start, pace.run))
    even, grown = ceil(left / workers), last * GROWTH
    fair = even if even * pace.run <= WAIT * pace.start else ceil(left / (2 * workers))
    fair = max(fair, min(even, _packs_of(pace.start, pace.run)))
    size = max(1, min(enough, fair, grown))
    if size == enough == 1 or size * workers >= left:
        return left, size
    if size == grown:
        return workers * size, size
    return min(left, max(workers, left // (2 * size)) * size), size


def _packs_of(seconds: float, run: float) -> int:
    """Runs that take some time together."""
    return ceil(min(MOST, seconds / run)) if run > 0 else MOST
