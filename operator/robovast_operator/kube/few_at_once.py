"""Many requests with a limit on how many are under way at once."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any

AT_ONCE = 8


async def few_at_once(acts: Iterable[Coroutine[Any, Any, None]]) -> None:
    """Run acts concurrently, a few at a time.

    After a failure the worker that met it stops, and the others continue. The first failure is
    raised when all have ended.

    Args:
        acts: created one by one, so that none is begun in vain after a failure.
    """
    left = iter(acts)

    async def row() -> None:
        for act in left:
            await act

    ends = await asyncio.gather(*(row() for _ in range(AT_ONCE)), return_exceptions=True)
    for end in ends:
        if end is not None:
            raise end
