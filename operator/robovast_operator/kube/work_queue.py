"""The queue of keys to reconcile: each once, by one worker, with delays after failures."""

from __future__ import annotations

import asyncio
import heapq
import random
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from robovast_operator.kube.objects import Key

FIRST_DELAY = 1.0
LONGEST_DELAY = 300.0
REFUSED_DELAY = 30.0
"""Longest delay after a refusal by the API server [s]: no event says when it will accept again."""


@dataclass
class WorkQueue:
    """A deduplicating queue with delays."""

    _due: list[tuple[float, Key]] = field(default_factory=list)
    _when: dict[Key, float] = field(default_factory=dict)
    _busy: set[Key] = field(default_factory=set)
    _failures: dict[Key, int] = field(default_factory=dict)
    _changed: asyncio.Event = field(default_factory=asyncio.Event)

    def __len__(self) -> int:
        return len(self._when)

    def add(self, key: Key, delay: float = 0.0) -> None:
        """Schedule a key after a delay [s]; an earlier schedule stays."""
        due = time.monotonic() + delay
        if due < self._when.get(key, float("inf")):
            self._when[key] = due
            heapq.heappush(self._due, (due, key))
            self._changed.set()

    def add_failed(self, key: Key, longest: float = LONGEST_DELAY) -> float:
        """Schedule a key again after a failure; return the delay [s], which doubles each time."""
        failures = self._failures.get(key, 0)
        self._failures[key] = failures + 1
        delay = min(longest, FIRST_DELAY * 2.0**failures) * random.uniform(0.8, 1.2)  # noqa: S311
        self.add(key, delay)
        return delay

    def failing(self, times: int) -> int:
        """How many keys have failed so many times in a row."""
        return sum(failures >= times for failures in self._failures.values())

    def succeeded(self, key: Key) -> None:
        """Forget the failures of a key."""
        self._failures.pop(key, None)

    async def take(self) -> Key:
        """The next key that is due; it is busy until `done`."""
        while True:
            wait = self._next_wait()
            if wait is not None and wait <= 0:
                _, key = heapq.heappop(self._due)
                if self._when.get(key, float("inf")) > time.monotonic():
                    continue  # it was put off, or taken, in between
                if key in self._busy:
                    self.add_later(key)
                    continue
                del self._when[key]
                self._busy.add(key)
                return key
            self._changed.clear()
            try:
                await asyncio.wait_for(self._changed.wait(), wait)
            except TimeoutError:
                continue

    def add_later(self, key: Key) -> None:
        """Schedule a key that a worker is busy with."""
        self._when.pop(key, None)
        self.add(key, 0.05)

    def done(self, key: Key) -> None:
        """Mark a key as finished by its worker."""
        self._busy.discard(key)
        self._changed.set()

    def _next_wait(self) -> float | None:
        return self._due[0][0] - time.monotonic() if self._due else None


async def work(queue: WorkQueue, reconcile: Callable[[Key], Awaitable[None]]) -> None:
    """Reconcile keys as they fall due, without end; `reconcile` never raises."""
    while True:
        key = await queue.take()
        try:
            await reconcile(key)
        finally:
            queue.done(key)
