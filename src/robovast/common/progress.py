"""Readable sizes and progress for plugins."""

from __future__ import annotations

import sys
import time

from robovast.base.sizes import fmt_size

__all__ = ["ProgressBar", "fmt_size"]


class ProgressBar:
    """One line on stderr that fills while bytes go by; silent when stderr is no terminal.

    Args:
        total: what is to be done [byte]; 0 when nobody knows.
        label: what it is about.
        width: of the bar [characters].
    """

    def __init__(self, total: int, label: str = "", width: int = 30) -> None:
        self._total = total
        self._label = label
        self._width = width
        self._shown = 0.0

    def update(self, done: int, total: int | None = None) -> None:
        """Show how much is done; also a `(done, total)` progress callback."""
        self._total = total or self._total
        now = time.monotonic()
        last = done >= self._total
        if sys.stderr.isatty() and (last or now - self._shown > 0.1):
            self._shown = now
            sys.stderr.write(f"\r{self.line(done)}" + ("\n" if last else ""))
            sys.stderr.flush()

    __call__ = update

    def line(self, done: int) -> str:
        """The line for an amount that is done."""
        from rich import progress_bar
        from rich.console import Console

        bar = progress_bar.ProgressBar(self._total or 1, done, self._width)
        console = Console(stderr=True)
        with console.capture() as drawn:
            console.print(bar, end="")
        return f"{self._label}  {drawn.get()}  {fmt_size(done)}/{fmt_size(self._total)}".strip()
