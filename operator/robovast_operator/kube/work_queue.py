"""The queue of keys to reconcile: each once, by one worker, with delays after failures.

Namespaces take turns, and none occupies all workers: neither many campaigns nor slow answers of
the API server in one namespace delay the campaigns of another one.
"""

from __future__ import annotations

import asyncio
import heapq
import random
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field

from robovast_operator.kube.objects import Key
from robovast_operator.kube.rotation import Rotation

WORKERS = 16
SHARE = 4
"""Maximum number of workers that reconcile campaigns of one namespace."""

DUE = float("-inf")
BUSY_DELAY = 0.05
"""Time between two looks whether a worker is still busy with a key [s]."""
FIRST_DELAY = 1.0
LONGEST_DELAY = 300.0
REFUSED_DELAY = 30.0
"""Longest delay after a rejection by the API server [s], whose end no event reports."""


@dataclass
class WorkQueue:
    """A deduplicating queue with delays."""

    _later: list[tuple[float, Key]] = field(default_factory=list)
    """Heap of the keys that are due in the future; entries that `_when` contradicts are void."""
    _due: Rotation[Key] = field(default_factory=Rotation)
    _when: dict[Key, float] = field(default_factory=dict)
    """When each key is due; `DUE` for those in `_due`."""
    _busy: set[Key] = field(default_factory=set)
    _workers: Counter[str] = field(default_factory=Counter)
    """Number of workers that are busy with each namespace."""
    _failures: dict[Key, int] = field(default_factory=dict)
    _changed: asyncio.Event = field(default_factory=asyncio.Event)

    def __len__(self) -> int:
        return len(self._when)

    def add(self, key: Key, delay: float = 0.0) -> None:
        """Schedule a key after a delay [s]; an earlier schedule stays."""
        due = time.monotonic() + delay
        if due < self._when.get(key, float("inf")):
            self._when[key] = due
            heapq.heappush(self._later, (due, key))
            self._changed.set()

    def add_failed(self, key: Key, longest: float = LONGEST_DELAY) -> float:
        """Schedule a key again after a failure; return the delay [s], which doubles each time."""
        failures = self._failures.get(key, 0)
        self._failures[key] = failures + 1
        delay = min(longest, FIRST_DELAY * 2.0**failures) * random.uniform(0.8, 1.2)  # noqa: S311
        self.add(key, delay)
        return delay

    def failing(self, times: int) -> int:
        """Return how many keys have failed so many times in a row."""
        return sum(failures >= times for failures in self._failures.values())

    def succeeded(self, key: Key) -> None:
        """Forget the failures of a key."""
        self._failures.pop(key, None)

    async def take(self) -> Key:
        """Return the next due key, which stays busy until `done`."""
        while True:
            self._collect_due()
            key = self._due.take(self._has_worker)
            if key is not None:
                del self._when[key]
                self._busy.add(key)
                self._workers[key[0]] += 1
                return key
            self._changed.clear()
            wait = self._later[0][0] - time.monotonic() if self._later else None
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), wait)

    def _collect_due(self) -> None:
        """Move due keys into the rotation of the namespaces."""
        while self._later and self._later[0][0] <= time.monotonic():
            due, key = heapq.heappop(self._later)
            if self._when.get(key) != due:
                continue  # the key was taken meanwhile, or is due earlier
            if key in self._busy:
                del self._when[key]
                self.add(key, BUSY_DELAY)
            else:
                self._when[key] = DUE
                self._due.add(key[0], key)

    def _has_worker(self, namespace: str) -> bool:
        return self._workers[namespace] < SHARE

    def done(self, key: Key) -> None:
        """Mark a key as finished by a worker."""
        self._busy.discard(key)
        self._workers[key[0]] -= 1
        if not self._workers[key[0]]:
            del self._workers[key[0]]
        self._changed.set()


async def work(queue: WorkQueue, reconcile: Callable[[Key], Awaitable[None]]) -> None:
    """Reconcile keys as they fall due, without end; `reconcile` never raises."""
    while True:
        key = await queue.take()
        try:
            await reconcile(key)
        finally:
            queue.done(key)
