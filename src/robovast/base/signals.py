"""Requests to stop: Ctrl-C, `kill`, a terminal that closes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def call_on_signals(action: Callable[[], None]) -> Iterator[None]:
    """Call `action` on SIGINT, SIGTERM and SIGHUP in place of what they did before.

    An exception out of nowhere, as Ctrl-C raises it, could lose what is being handled. SIGHUP stays
    ignored under nohup; SIGINT is taken even where it arrived ignored (a background job of a
    shell), since what is ignored here would be ignored by every program that we start.

    Signals reach the main thread alone; in another one nothing is changed.
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
