"""Show a line on the terminal during long work."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from threading import Event, Thread

AFTER = 1.0
"""Minimum duration of work that is shown [s]."""
EVERY = 0.2
"""Time between two updates [s]."""
_CLEAR = "\r\x1b[K"

_log = logging.getLogger(__name__)


@contextmanager
def progress_line(title: str) -> Iterator[Callable[[str], None]]:
    """Show the current work and its duration on a terminal, and remove the line at the end.

    Yields:
        Function that shows the current step.
    """
    step = [""]
    done = Event()
    thread = Thread(target=_show, args=(title, step, done), daemon=True)
    if sys.stderr.isatty():
        thread.start()

    def show(text: str) -> None:
        _log.info("%s", text)
        step[0] = text

    try:
        yield show
    finally:
        done.set()
        if thread.is_alive():
            thread.join()


def _show(title: str, step: list[str], done: Event) -> None:
    began = time.monotonic()
    if done.wait(AFTER):
        return
    while True:
        line = f"{title} … {time.monotonic() - began:.0f} s  {step[0]}".replace("\n", " ")
        sys.stderr.write(_CLEAR + line[: get_terminal_size().columns - 1])
        sys.stderr.flush()
        if done.wait(EVERY):
            break
    sys.stderr.write(_CLEAR)
    sys.stderr.flush()
