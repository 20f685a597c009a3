"""An end to code of users that hangs."""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from robovast.kubeapi.pod_contract.exit_codes import AgentExit


@contextmanager
def deadline(seconds: float, tell: Callable[[str], None]) -> Iterator[None]:
    """End the process if what is within takes longer; before that, tell where it is.

    It is no exception: whatever hangs may catch any, or not be in Python.
    """
    thread = threading.get_ident()

    def end() -> None:
        try:
            tell(_where(sys._current_frames().get(thread)))
        finally:
            os._exit(AgentExit.BAD_DOCUMENT)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _where(frame: FrameType | None) -> str:
    """The innermost place, such as `ask (strategy.py:12)`; all of its callers are in the log."""
    stack = traceback.extract_stack(frame)
    traceback.print_list(stack)
    last = stack[-1]
    return f"`{last.name}` ({Path(last.filename).name}:{last.lineno})"
