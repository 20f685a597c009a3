"""Readable sizes."""

from __future__ import annotations


def fmt_size(size: float) -> str:
    """A number of bytes as `1.2 MiB`."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if abs(size) < 1024:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1024
    return f"{size:.1f} TiB"
