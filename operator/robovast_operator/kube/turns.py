"""Who shares a limited number of pods takes turns: what one has taken, the next one sees."""

from __future__ import annotations

from asyncio import Lock
from collections.abc import Container
from contextlib import AbstractAsyncContextManager, nullcontext

OTHERS = "*"
"""Among limits by namespace: every namespace that has none of its own."""


class Turns:
    """Turns of the campaigns of a namespace, in those whose pods are limited."""

    def __init__(self, limited: Container[str]) -> None:
        self._limited = limited
        self._locks: dict[str, Lock] = {}

    def of(self, namespace: str) -> AbstractAsyncContextManager[object]:
        """A turn among the campaigns of a namespace; no campaign of another one waits for it."""
        if namespace not in self._limited and OTHERS not in self._limited:
            return nullcontext()
        return self._locks.setdefault(namespace, Lock())
