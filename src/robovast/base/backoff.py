"""Backoff: how long to wait before a server is asked again."""

from __future__ import annotations

import random
import time

FIRST_PAUSE = 0.25
"""Longest pause before the second attempt [s]; it doubles with each further one."""
LONGEST_PAUSE = 15.0
"""[s]"""
BUSY = frozenset({429, 500, 502, 503, 504})
"""HTTP statuses of a server that may answer later."""


class Pauses:
    """Pauses of random length that grow exponentially, until `patience` is used up.

    Args:
        patience: for how long to try, whatever the attempts take [s].
        attempts: how many further attempts there are even so: one may take longer than that.
    """

    def __init__(self, patience: float, attempts: int = 0) -> None:
        self._patience = patience
        self._attempts = attempts
        self.reset()

    def reset(self) -> None:
        """Something went well: be patient anew."""
        self._deadline = time.monotonic() + self._patience
        self._longest = FIRST_PAUSE
        self._free = self._attempts

    def wait(self, at_least: float = 0.0) -> bool:
        """Wait before the next attempt; False, at once, when none is left.

        Args:
            at_least: what the server asks for [s]; when that is more than is left, no attempt is.
        """
        left = self._deadline - time.monotonic()
        if self._free:
            self._free -= 1
            left = max(left, self._longest)
        if left <= at_least:
            return False
        pause = random.uniform(self._longest / 2, self._longest)  # noqa: S311
        time.sleep(min(left, max(at_least, pause)))
        self._longest = min(2 * self._longest, LONGEST_PAUSE)
        return True
