"""Connections that wait for a request: any user of the machine can open them, so they are bounded.

A request that has arrived is answered, whatever else waits: its connection is not counted.
"""

from __future__ import annotations

import asyncio
from typing import ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST = 256
"""Most connections that wait for a request; a new one replaces the oldest."""
PATIENCE = 10.0
"""How long a request's head may take to arrive [s]."""


class Connection(H11Protocol):
    """A connection that is closed if no request arrives."""

    _waiting: ClassVar[dict[Connection, asyncio.TimerHandle]] = {}
    """From the oldest to the newest."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for the first request."""
        super().connection_made(transport)  # type: ignore[arg-type]
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Handle a part of a request."""
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            self._end_wait()

    def on_response_complete(self) -> None:
        """Wait for the next request, unless many do: those may never have been answered."""
        super().on_response_complete()
        if len(self._waiting) >= MOST:
            self.transport.close()
        elif not self.transport.is_closing():
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._end_wait()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._end_wait()
        self._waiting[self] = self.loop.call_later(PATIENCE, self.transport.abort)
        if len(self._waiting) > MOST:
            oldest = next(iter(self._waiting))
            oldest._end_wait()
            oldest.transport.abort()

    def _end_wait(self) -> None:
        if timer := self._waiting.pop(self, None):
            timer.cancel()
