"""The time line that people see: from 0, without long pauses, in simulated time where there is one.

A simulation runs quicker or slower than its recording, whose messages carry the simulated time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robovast.analysis.episodes import episode_starts

SECOND = 1_000_000_000
_SAME_PACE = 0.1
"""Difference in pace up to which recording and stamps count as equally fast."""
_MOST_AT_ONCE = 0.9
"""Share of all time that passes by stamps between two samples only if they jump."""
LONGEST_PAUSE = 60.0
"""Pause in a recording that is not shown [s]."""
_SHOWN_PAUSE = 1.0
"""What is shown in its place [s]."""
_TOLERANCE = 1.0
"""How far a message's stamp may lie outside of the time line [s]."""


@dataclass(frozen=True)
class Clock:
    """Converts times of receipt and stamps to seconds on the time line."""

    received: tuple[int, ...]
    """Times of receipt [ns], in order."""
    shown: tuple[float, ...]
    """The same moments on the time line [s], in order."""
    first_stamp: int | None = None
    """Stamp of the time line's beginning [ns]; None if stamps are not used."""
    remarks: tuple[str, ...] = ()

    @property
    def end(self) -> float:
        """Length of the time line [s]."""
        return self.shown[-1]

    def at(self, received: int, stamp: int | None = None) -> float:
        """Place of a message on the time line [s]."""
        if stamp is not None and self.first_stamp is not None:
            place = (stamp - self.first_stamp) / SECOND
            if -_TOLERANCE <= place <= self.end + _TOLERANCE:
                return max(0.0, place)
        return _interpolated(self.received, self.shown, received)

    def receipt(self, shown: float) -> int:
        """Time of receipt [ns] of a place on the time line."""
        return round(_interpolated(self.shown, self.received, shown))


def make_clock(
    start: int, end: int, moments: Sequence[int], stamps: Sequence[tuple[int, int]]
) -> Clock:
    """The clock of a recording.

    Args:
        start: time of its first message [ns].
        end: time of its last message [ns].
        moments: times of receipt at both ends of every long pause, and others, in order [ns].
        stamps: time of receipt and stamp of some messages, in order of receipt [ns].
    """
    remarks: list[str] = []
    if jump := _jump(stamps):
        episodes = len(episode_starts(*np.array(stamps, np.int64).T[::-1])) + 1
        known = f" The recording has at least {episodes} episodes." if episodes > 1 else ""
        remarks.append(
            f"The stamps of the robot's poses jump {jump}, so the timeline uses the times of the "
            f"recording.{known}"
        )
    elif simulated := _simulated(start, end, stamps):
        return simulated
    points, pauses = _without_pauses(start, end, moments)
    if pauses:
        remarks.append(
            f"For {pauses[0]:,.0f} s nothing was recorded"
            + (f", and {len(pauses) - 1} more times for long" if pauses[1:] else "")
            + "; the time line leaves that out."
        )
    received, shown = zip(*points, strict=True)
    return Clock(received, shown, None, tuple(remarks))


def _jump(stamps: Sequence[tuple[int, int]]) -> str:
    """Where stamps jump to; empty if they pass evenly."""
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(stamps)]
    if any(passed < 0 for _, passed in steps):
        return "back"
    recorded, passed = (sum(values) for values in zip(*steps, strict=True)) if steps else (0, 0)
    sudden = any(
        passed_here > _MOST_AT_ONCE * passed and recorded_here < recorded * _MOST_AT_ONCE / 2
        for recorded_here, passed_here in steps
    )
    return "ahead" if sudden else ""


def _simulated(start: int, end: int, stamps: Sequence[tuple[int, int]]) -> Clock | None:
    """The clock by stamps, if these are not as fast as the recording."""
    if len(stamps) < 2:
        return None
    recorded = stamps[-1][0] - stamps[0][0]
    passed = stamps[-1][1] - stamps[0][1]
    if passed <= 0 or recorded <= 0 or abs(passed / recorded - 1) < _SAME_PACE:
        return None
    pace = passed / recorded
    first = stamps[0][1] - round((stamps[0][0] - start) * pace)
    points = {start: 0.0}
    for received, stamp in stamps:
        points[max(received, start)] = (stamp - first) / SECOND
    last, place = max(points.items())
    if end > last:
        points[end] = place + (end - last) * pace / SECOND
    return Clock(tuple(points), tuple(points.values()), first)


def _without_pauses(
    start: int, end: int, moments: Sequence[int]
) -> tuple[list[tuple[int, float]], list[float]]:
    """Points of the clock, and the pauses that it leaves out [s]."""
    points, left_out = [(start, 0.0)], 0.0
    pauses: list[float] = []
    for earlier, later in pairwise(sorted({start, *moments, end})):
        pause = (later - earlier) / SECOND
        if pause > LONGEST_PAUSE and start <= earlier and later <= end:
            pauses.append(pause)
            points.append((earlier, (earlier - start) / SECOND - left_out))
            left_out += pause - _SHOWN_PAUSE
            points.append((later, (later - start) / SECOND - left_out))
    points.append((end, (end - start) / SECOND - left_out))
    return points, pauses


def _interpolated(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    after = bisect_right(xs, x)
    before = after - 1
    width = xs[after] - xs[before]
    share = (x - xs[before]) / width if width else 0.0
    return ys[before] + share * (ys[after] - ys[before])
