"""A stopwatch that is independent of changes of the machine's clock."""

from __future__ import annotations

import time


class Stopwatch:
    """Measures the time since its creation or an earlier moment."""

    def __init__(self, began: float | None = None, late: float = 0.0) -> None:
        """Start it.

        Args:
            began: start as wall-clock time [s since the epoch]; None means now.
            late: time that has passed since then [s].
        """
        self._began = time.time() if began is None else began
        self._start = time.monotonic() - late

    @property
    def seconds(self) -> float:
        """Elapsed time [s]."""
        return time.monotonic() - self._start

    @property
    def period(self) -> tuple[float, float]:
        """Start and end of the measured period [s since the epoch]."""
        return self._began, self._began + self.seconds
