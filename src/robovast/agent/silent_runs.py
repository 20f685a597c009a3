"""Notices runs that write nothing: they may hang, and without a timeout nothing ends them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

SILENT = "silent"
"""A file in the pod's own volume, for the pod's probe; it exists while a run is silent."""


LOOK_SECONDS = 5.0


class Silence:
    """Watches how a job's log grows."""

    def __init__(self, marker: Path, seconds: float) -> None:
        """Begin.

        Args:
            marker: the file that exists while the job is silent.
            seconds: how long a job may write nothing; 0: for ever.
        """
        self._marker = marker
        self._seconds = seconds
        self._size = -1
        self._since = self._next = time.monotonic()
        self._told = False

    def look(self, log: Callable[[], Path]) -> None:
        """Check the log of the running job periodically."""
        now = time.monotonic()
        if not self._seconds or now < self._next:
            return
        self._next = now + min(LOOK_SECONDS, self._seconds / 2)
        size = _size(log())
        if size != self._size:
            self._size, self._since = size, now
        self._report(now - self._since > self._seconds)

    def end(self) -> None:
        """Stop watching: the job has ended."""
        self._size = -1
        self._report(False)

    def _report(self, silent: bool) -> None:
        if silent and not self._told:
            self._marker.touch()
        elif self._told and not silent:
            self._marker.unlink(missing_ok=True)
        self._told = silent


def _size(log: Path) -> int:
    try:
        return log.lstat().st_size
    except OSError:  # there is none yet, or whose the folder is has locked it
        return 0
