"""Patience with servers: how long to wait before asking again."""

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
    """Pauses of random length that grow exponentially, until `patience` is used up."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """Something went well: be patient anew."""
        self._deadline = time.monotonic() + self._patience
        self._longest = FIRST_PAUSE

    def wait(self, at_least: float = 0.0) -> bool:
        """Wait before the next attempt; False, at once, when none is left.

        Args:
            at_least: what the server asks for [s]; when that is more than is left, no attempt is.
        """
        left = self._deadline - time.monotonic()
        if left <= at_least:
            return False
        pause = random.uniform(self._longest / 2, self._longest)  # noqa: S311
        time.sleep(min(left, max(at_least, pause)))
        self._longest = min(2 * self._longest, LONGEST_PAUSE)
        return True
