"""Backoff: how long a request to a server is repeated, and how long to wait before that."""

from __future__ import annotations

import random
import time
from collections.abc import Callable

HOLDING_RESULTS = 600.0
"""Time limit of retries for a process that holds results which exist nowhere else [s]."""
REPEATABLE = 60.0
"""Time limit of retries for work that can be repeated: it soon ends and says why [s]."""
TRANSFERRING = 300.0
"""Time limit of retries for uploads to and downloads from other servers [s]."""
FIRST_CONTACT = 5.0
"""Time limit of retries for a server that never answered: its address may be wrong [s]."""

FIRST_PAUSE = 0.25
"""Longest pause before the second attempt [s]; it doubles with each further attempt."""
LONGEST_PAUSE = 15.0
"""[s]"""
BUSY = frozenset({429, 500, 502, 503, 504})
"""HTTP statuses of temporary errors."""


class Pauses:
    """Random pauses that grow exponentially until `patience` is used up.

    Args:
        patience: how long to try in total [s].
        attempts: minimum number of further attempts, even if a single one takes longer than that.
    """

    def __init__(self, patience: float, attempts: int = 0) -> None:
        self._patience = patience
        self._attempts = attempts
        self.reset()

    def reset(self) -> None:
        """Start again with full patience, after a success."""
        self._deadline = time.monotonic() + self._patience
        self._longest = FIRST_PAUSE
        self._free = self._attempts

    def wait(self, at_least: float = 0.0) -> bool:
        """Wait before the next attempt; return False immediately if none is left.

        Args:
            at_least: pause that the server requests [s]; no attempt is left if it exceeds the
                patience.
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


def wait_until(condition: Callable[[], bool], patience: float, pause: float) -> bool:
    """Wait until a condition holds; return False if that takes too long.

    Args:
        condition: checks it.
        patience: the time limit [s].
        pause: time between two checks [s].
    """
    give_up = time.monotonic() + patience
    while not condition():
        if time.monotonic() > give_up:
            return False
        time.sleep(pause)
    return True
