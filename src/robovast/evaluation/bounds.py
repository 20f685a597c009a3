"""Bounds what reading one untrusted bag may cost."""

from __future__ import annotations

import time

SECONDS = 10.0
"""Longest scan of a file."""
MOST_RECORDS = 5_000_000
_EVERY = 256
"""Records between looks at the clock."""
_KNOWN = range(1, 16)
_PRIVATE = 0x80


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


def is_record(opcode: int) -> bool:
    """Whether a record of MCAP may begin with an opcode; zeros and other garbage do not."""
    return opcode in _KNOWN or opcode >= _PRIVATE
