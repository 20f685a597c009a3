"""A line on the terminal while something takes its time."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from threading import Event, Thread

AFTER = 1.0
"""Shorter work is not shown [s]."""
EVERY = 0.2
"""[s]"""
_CLEAR = "\r\x1b[K"

_log = logging.getLogger(__name__)

Tell = Callable[[str], None]


@contextmanager
def progress_line(what: str) -> Iterator[Tell]:
    """Show the current work and its duration on a terminal; the line disappears at the end.

    Args:
        what: is being done.

    Yields:
        Takes what of it is being done right now.
    """
    news = [""]
    done = Event()
    thread = Thread(target=_show, args=(what, news, done), daemon=True)
    if sys.stderr.isatty():
        thread.start()

    def show(text: str) -> None:
        _log.info("%s", text)
        news[0] = text

    try:
        yield show
    finally:
        done.set()
        if thread.is_alive():
            thread.join()


def _show(what: str, news: list[str], done: Event) -> None:
    began = time.monotonic()
    if done.wait(AFTER):
        return
    while True:
        line = f"{what} … {time.monotonic() - began:.0f} s  {news[0]}".replace("\n", " ")
        sys.stderr.write(_CLEAR + line[: get_terminal_size().columns - 1])
        sys.stderr.flush()
        if done.wait(EVERY):
            break
    sys.stderr.write(_CLEAR)
    sys.stderr.flush()
