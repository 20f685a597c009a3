"""Sizes as text."""

from __future__ import annotations

import re


def fmt_size(size: float) -> str:
    """A number of bytes as `1.2 MiB`."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if abs(size) < 1024:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1024
    return f"{size:.1f} TiB"


def whole_number(text: str | None, default: int = 0) -> int:
    """A size or an offset that a server or a user gives; the default if it is none."""
    valid = text is not None and re.fullmatch("[0-9]{1,18}", text)
    return int(valid[0]) if valid else default
