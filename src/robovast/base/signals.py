"""Handles requests to stop: Ctrl-C, `kill`, a closed terminal."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def call_on_signals(action: Callable[[], None]) -> Iterator[None]:
    """Call `action` on SIGINT, SIGTERM and SIGHUP in place of the previous handlers.

    An exception at an arbitrary moment, as Ctrl-C raises it, could interrupt critical work. SIGHUP
    stays ignored under nohup. SIGINT is handled even if it was ignored (in a background job),
    since all programs that we start would inherit that.

    Only the main thread receives signals; in other threads nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: FrameType | None) -> None:
        del number, frame
        action()

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def unwound_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise SystemExit, so that what is open is closed before the end.

    SIGHUP stays ignored under nohup. Ctrl-C raises KeyboardInterrupt anyway.
    """

    def end(number: int, frame: FrameType | None) -> None:
        del frame
        raise SystemExit(128 + number)

    ended = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is signal.SIG_DFL]
    for number in ended:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ended:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def end_at_ctrl_c() -> Iterator[None]:
    """Let Ctrl-C end the process at once, even within a library that looks at signals rarely.

    It is for work that leaves nothing behind.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
