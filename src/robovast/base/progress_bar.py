"""Readable sizes and progress."""

from __future__ import annotations

import sys
import time


def fmt_size(size: float) -> str:
    """A number of bytes as `1.2 MiB`."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if abs(size) < 1024:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1024
    return f"{size:.1f} TiB"


class ProgressBar:
    """A progress line on stderr; silent unless stderr is a terminal.

    Args:
        total: total amount; 0 if unknown.
        label: text before the bar.
        width: width of the bar [characters].
    """

    def __init__(self, total: int, label: str = "", width: int = 30) -> None:
        self._total = total
        self._label = label
        self._width = width
        self._shown = 0.0

    def update(self, done: int, total: int | None = None) -> None:
        """Show the progress; usable as a `(done, total)` callback."""
        self._total = total or self._total
        now = time.monotonic()
        last = done >= self._total
        if sys.stderr.isatty() and (last or now - self._shown > 0.1):
            self._shown = now
            sys.stderr.write(f"\r{self.line(done)}" + ("\n" if last else ""))
            sys.stderr.flush()

    __call__ = update

    def line(self, done: int) -> str:
        """The line for an amount."""
        share = min(1.0, done / self._total) if self._total else 0.0
        filled = round(share * self._width)
        bar = "█" * filled + "░" * (self._width - filled)
        sizes = f"{fmt_size(done)}/{fmt_size(self._total)}"
        return f"{self._label}  [{bar}] {share:6.1%}  {sizes}".strip()
