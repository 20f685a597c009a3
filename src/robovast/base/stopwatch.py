"""A stopwatch that changes of the machine's clock do not disturb."""

from __future__ import annotations

import time


class Stopwatch:
    """Runs from when it is made, or from before."""

    def __init__(self, began: float | None = None, late: float = 0.0) -> None:
        """Start it.

        Args:
            began: when that is, as people read it [s since the epoch]; now when None.
            late: how long that has been already [s].
        """
        self._began = time.time() if began is None else began
        self._start = time.monotonic() - late

    @property
    def seconds(self) -> float:
        """How long it has run [s]."""
        return time.monotonic() - self._start

    @property
    def period(self) -> tuple[float, float]:
        """From when to when it has run [s since the epoch]."""
        return self._began, self._began + self.seconds
