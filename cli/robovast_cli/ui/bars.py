"""Progress bars, on a terminal only."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Self

from robovast.base.printable import printable
from robovast_cli.ui.live_view import is_live

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

ROOMY = 100
"""Minimum width of a terminal for the speed of a bar [characters]."""


class Bars:
    """Progress bars on stderr.

    Args:
        of_bytes: amounts are bytes, shown with their speed.
        transient: remove the bars at the end.
    """

    def __init__(self, *, of_bytes: bool = True, transient: bool = False) -> None:
        self._of_bytes = of_bytes
        self._transient = transient
        self._shown: Progress | None = None
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *how: object) -> None:
        """Remove the bars from the terminal."""
        self.close()

    def __call__(self, name: str, done: int, total: int, note: str = "") -> None:
        """Show the progress of a task; usable as a progress callback."""
        if not is_live(sys.stderr):
            return
        if self._shown is None:
            self._shown = self._new_progress()
            self._shown.start()
        if name not in self._tasks:
            self._tasks[name] = self._shown.add_task(printable(name), total=total, note=note)
        self._shown.update(self._tasks[name], completed=done, total=total, note=note)

    def close(self) -> None:
        """Stop the current bars; the next call starts new ones."""
        if self._shown is not None:
            self._shown.stop()
        self._shown, self._tasks = None, {}

    def _new_progress(self) -> Progress:
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        console = Console(stderr=True)
        short = Column(no_wrap=True, overflow="ellipsis", max_width=max(15, console.width // 3))
        whole = Column(no_wrap=True)
        speed = (progress.TransferSpeedColumn(),) if console.width >= ROOMY else ()
        of_bytes = (progress.DownloadColumn(table_column=whole), *speed)
        return progress.Progress(
            progress.TextColumn("{task.description}", markup=False, table_column=short),
            progress.BarColumn(),
            *(of_bytes if self._of_bytes else (progress.MofNCompleteColumn(),)),
            progress.TextColumn("{task.fields[note]}", table_column=whole),
            progress.TimeRemainingColumn(table_column=whole),
            console=console,
            transient=self._transient,
            redirect_stdout=sys.stdout.isatty(),
        )
