"""Server-sent events: the page learns of changes without polling."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import AsyncIterator, Mapping
from typing import Any

from robovast.base.errors import InputError
from robovast.evaluation.library import Library
from robovast.evaluation.server.launches import LaunchPages, News
from robovast.evaluation.server.preparing import Preparation, Prepared

PERIOD = 1.0
"""Interval between checks for changes [s]."""


async def events(
    library: Library,
    launches: LaunchPages,
    closing: asyncio.Event,
    preparation: Preparation | None = None,
) -> AsyncIterator[str]:
    """Events until the server closes.

    An event contains `{name: version}` of changed campaigns, with None for removed ones; the first
    event contains all campaigns. Events of the kind `launch` report a campaign started from the
    page; see `News`. Events of the kind `preparing` report tables that are still made; see
    `Prepared`.
    """
    sent: dict[str, int] = {}
    told: News | None = None
    prepared: Prepared | None = None
    first = True
    while not closing.is_set():
        now = await asyncio.to_thread(versions, library)
        changes: dict[str, int | None] = {n: v for n, v in now.items() if sent.get(n) != v}
        changes |= dict.fromkeys(sent.keys() - now.keys())
        if changes or first:
            yield _event(changes)
        else:
            yield ": nothing new\n\n"  # detects closed connections
        if news := launches.news(told):
            yield _event(dataclasses.asdict(news), "launch")
            told = news
        if preparation and (state := preparation.state()) != prepared:
            yield _event(dataclasses.asdict(state), "preparing")
            prepared = state
        sent, first = now, False
        try:
            await asyncio.wait_for(closing.wait(), PERIOD)
        except TimeoutError:
            continue


def versions(library: Library) -> dict[str, int]:
    """Versions of all campaigns, refreshed if necessary; 0 for unreadable ones."""
    try:
        names = library.names()
    except InputError:  # the folder is gone; the next request reports it
        return {}
    return {name: _version(library, name) for name in names}


def _version(library: Library, name: str) -> int:
    try:
        return library.summary(name).version
    except InputError:  # the list of campaigns reports the reason
        return 0


def _event(data: Mapping[str, Any], kind: str = "message") -> str:
    return f"event: {kind}\ndata: {json.dumps(data)}\n\n"
