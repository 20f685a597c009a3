"""Episodes of a recording: the stretches between jumps back in time, such as simulation resets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]

_JITTER = 500_000_000
"""Difference up to which a stamp may be earlier than a previous one in the same episode [ns]."""
_LATE = 100
"""Maximum number of late messages in succession."""


def episode_starts(stamps: Times, received: Times) -> list[int]:
    """Return the indexes at which stamps begin a new episode; the first episode is not listed.

    Messages that arrive late do not begin an episode, because the stamps catch up with the previous
    ones by a leap. After a reset, the stamps pass again at the pace of the recording.

    Args:
        stamps: (n,) stamps of one source in order of receipt [ns].
        received: (n,) times of receipt [ns]; all equal if they are unknown.
    """
    backward = np.flatnonzero(stamps[1:] < stamps[:-1]) + 1
    if not len(backward):
        return []
    starts: list[int] = []
    jitter = min(_JITTER, int(stamps.max() - stamps.min()) // 2)
    latest = int(stamps[0])
    for index in backward.tolist():
        latest = max(latest, int(stamps[index - 1]))
        lost = latest - int(stamps[index])
        if lost > jitter and not _is_late(stamps, received, index, latest):
            starts.append(index)
            latest = int(stamps[index])
    return starts


def _is_late(stamps: Times, received: Times, index: int, latest: int) -> bool:
    """Whether the stamps from an index on soon catch up with the latest one by a leap."""
    later = np.flatnonzero(stamps[index : index + _LATE] > latest)
    if not len(later):
        return False
    end = index + int(later[0])
    leap = int(stamps[end] - stamps[end - 1]) - int(received[end] - received[end - 1])
    return leap * 4 > (latest - int(stamps[index])) * 3
