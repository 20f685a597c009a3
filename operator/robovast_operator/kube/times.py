"""Times as Kubernetes writes them, and by its clock."""

from __future__ import annotations

import time
from calendar import timegm
from datetime import UTC, datetime
from email.utils import parsedate

NEARLY = 2.0
"""`Date` has whole seconds and arrives late: differences up to this are no other time [s]."""


def parse_time(text: str) -> datetime:
    """A time of `2026-11-21T07:00:00Z`."""
    return datetime.fromisoformat(text.replace("Z", "+00:00"))


def format_time(moment: datetime) -> str:
    """`2026-11-21T07:00:00Z`."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def hear(date: str) -> None:
    """Set the clock by the API server's, by which its objects are; our machine's may be wrong.

    Args:
        date: the header `Date` of its answer.
    """
    global _boot
    told = parsedate(date)
    if told is not None:
        boot = timegm(told) - time.monotonic()
        if _boot is None or abs(boot - _boot) > NEARLY:
            _boot = boot


_boot: float | None = None
"""The time when the steady clock said zero; None as long as no server has told [s]."""


def now() -> datetime:
    """The time now, UTC."""
    return datetime.fromtimestamp(time.time() if _boot is None else _boot + time.monotonic(), UTC)
