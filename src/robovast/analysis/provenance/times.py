"""Times as ISO 8601 in UTC."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any


def now() -> str:
    """This moment."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def as_utc(time: Any) -> str | None:
    """Convert a time to UTC; None if it is not a time. Times without a zone count as UTC."""
    try:
        parsed = time if isinstance(time, datetime) else datetime.fromisoformat(str(time))
        zoned = parsed if parsed.tzinfo else parsed.replace(tzinfo=UTC)
        return zoned.astimezone(UTC).isoformat()
    except (ValueError, OverflowError):
        return None


def from_epoch(seconds: float | None) -> str | None:
    """A time in seconds since the epoch."""
    try:
        return datetime.fromtimestamp(seconds, UTC).isoformat() if seconds else None
    except (ValueError, OverflowError, OSError):
        return None


def later(time: str | None, seconds: Any) -> str | None:
    """A time some seconds after another; None if either is unknown."""
    if time is None or not isinstance(seconds, int | float) or not 0 <= seconds < 1e9:
        return None
    try:
        return (datetime.fromisoformat(time) + timedelta(seconds=seconds)).isoformat()
    except OverflowError:
        return None
