"""Bounds what reading one untrusted file may cost."""

from __future__ import annotations

import time

LARGEST = 64 << 20
"""Largest piece of a file, decompressed or not, that is held in memory [bytes]."""
SECONDS = 10.0
"""Longest scan of a file for an interactive answer."""
PATIENT = 600.0
"""Longest scan of a file in a batch [s]."""
MOST_RECORDS = 5_000_000
"""Records of a file that are scanned for an interactive answer."""
_EVERY = 256
"""Records between looks at the clock."""


class Bound:
    """How much of a file may still be scanned."""

    def __init__(self, seconds: float = SECONDS, records: int = MOST_RECORDS) -> None:
        self._end = time.monotonic() + seconds
        self._left = records

    def reached(self) -> bool:
        """Count a record; whether it is one too many or too late."""
        self._left -= 1
        return self._left < 0 or (self._left % _EVERY == 0 and self.late())

    def late(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self._end

    @property
    def seconds_left(self) -> float:
        """Until the time is over [s]."""
        return self._end - time.monotonic()


def patient() -> Bound:
    """The bound of batches, which read large files without a waiting user."""
    return Bound(PATIENT, 1 << 40)
