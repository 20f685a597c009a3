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
    ones by a leap. After a reset, the stamps pass again at the pace of the recording. At the end of
    the recording, as many late messages as earlier in the episode do not begin an episode, nor does
    a single message, unless it is not later than the beginning of the episode.

    Args:
        stamps: (n,) stamps of one source in order of receipt [ns].
        received: (n,) times of receipt [ns]; all equal if they are unknown.
    """
    backward = np.flatnonzero(stamps[1:] < stamps[:-1]) + 1
    if not len(backward):
        return []
    starts: list[int] = []
    jitter = min(_JITTER, int(stamps.max() - stamps.min()) // 2)
    latest, longest, begin = int(stamps[0]), 0, 0
    for index in backward.tolist():
        latest = max(latest, int(stamps[index - 1]))
        lost = latest - int(stamps[index])
        if lost <= jitter:
            continue
        late = _late(stamps, received, index, latest)
        rest = len(stamps) - index
        if late is None and (longest or stamps[index] > stamps[begin]):
            late = rest if rest <= longest + 1 else 0
        if late:
            longest = max(longest, late)
        else:
            starts.append(index)
            latest, longest, begin = int(stamps[index]), 0, index
    return starts


def _late(stamps: Times, received: Times, index: int, latest: int) -> int | None:
    """Number of stamps from an index on until they catch up with the latest one by a leap.

    Returns:
        0 if they do not soon or not by a leap; None if the recording ends before.
    """
    following = stamps[index : index + _LATE]
    later = np.flatnonzero(following > latest)
    if not len(later):
        return 0 if len(following) == _LATE else None
    end = index + int(later[0])
    leap = int(stamps[end] - stamps[end - 1]) - int(received[end] - received[end - 1])
    return int(later[0]) if leap * 4 > (latest - int(stamps[index])) * 3 else 0
