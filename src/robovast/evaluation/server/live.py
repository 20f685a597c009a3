"""Server-sent events: a page learns that a campaign has changed without asking again."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import AsyncIterator, Mapping
from typing import Any

from robovast.base.errors import InputError
from robovast.evaluation.library import Library
from robovast.evaluation.server.launches import LaunchPages, News

PERIOD = 1.0
"""How often changes are looked for [s]."""


async def events(
    library: Library, launches: LaunchPages, closing: asyncio.Event
) -> AsyncIterator[str]:
    """What happens, until the server is closing.

    Changes of the versions of all campaigns, each `{name: version}`; None for one that is gone. The
    first event has all campaigns. Events of the kind `launch` tell of a campaign that was started
    from the page, see `News`.
    """
    sent: dict[str, int] = {}
    told: News | None = None
    first = True
    while not closing.is_set():
        now = await asyncio.to_thread(versions, library)
        changes: dict[str, int | None] = {n: v for n, v in now.items() if sent.get(n) != v}
        changes |= dict.fromkeys(sent.keys() - now.keys())
        if changes or first:
            yield _event(changes)
        else:
            yield ": nothing new\n\n"  # a connection that is gone is noticed by this
        if news := launches.news(told):
            yield _event(dataclasses.asdict(news), "launch")
            told = news
        sent, first = now, False
        try:
            await asyncio.wait_for(closing.wait(), PERIOD)
        except TimeoutError:
            continue


def versions(library: Library) -> dict[str, int]:
    """Versions of all campaigns, each read if it has changed; 0 for one that cannot be read."""
    try:
        names = library.names()
    except InputError:  # the folder is gone; the page's next request says so
        return {}
    return {name: _version(library, name) for name in names}


def _version(library: Library, name: str) -> int:
    try:
        return library.summary(name).version
    except InputError:  # the list of campaigns says why
        return 0


def _event(data: Mapping[str, Any], kind: str = "message") -> str:
    return f"event: {kind}\ndata: {json.dumps(data)}\n\n"
