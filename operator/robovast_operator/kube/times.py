"""Timestamps in Kubernetes' format, and the API server's clock."""

from __future__ import annotations

import time
from calendar import timegm
from datetime import UTC, datetime
from email.utils import parsedate

NEARLY = 2.0
"""`Date` has whole seconds and arrives late: differences up to this are no other time [s]."""


def parse_time(text: str) -> datetime:
    """Parse a timestamp such as `2026-11-21T07:00:00Z`."""
    return datetime.fromisoformat(text.replace("Z", "+00:00"))


def format_time(moment: datetime) -> str:
    """Return `2026-11-21T07:00:00Z`."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def hear(date: str) -> None:
    """Set the operator's clock by the API server's clock, because the local clock may be wrong.

    Args:
        date: the header `Date` of its answer.
    """
    global _boot
    date_time = parsedate(date)
    if date_time is not None:
        boot = timegm(date_time) - time.monotonic()
        if _boot is None or abs(boot - _boot) > NEARLY:
            _boot = boot


_boot: float | None = None
"""The server's time when the monotonic clock was zero [s]; None until a server has answered."""


def now() -> datetime:
    """Return the current time by the server's clock, UTC."""
    return datetime.fromtimestamp(time.time() if _boot is None else _boot + time.monotonic(), UTC)
