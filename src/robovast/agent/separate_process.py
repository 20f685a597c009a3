"""Work in a process of its own, whose memory is free again when it has ended."""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from threading import Event
from typing import NoReturn

LOOK = 0.02
"""How often to look whether the process has ended [s]."""


def apart(work: Callable[[], int], meanwhile: Callable[[], None], stop: Event) -> int:
    """Do work in a copy of this process, which must not have started a thread.

    Args:
        work: returns the exit code.
        meanwhile: what to begin here when the copy is made, such as a thread.
        stop: ends the work as soon as it is set.

    Returns:
        The exit code of the process; if a signal has ended it, the negative number of that.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if not pid:
        _do_and_end(work)
    meanwhile()
    while not stop.is_set():  # a handler that sets it while this thread waits for it may hang
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(LOOK)
    os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _do_and_end(work: Callable[[], int]) -> NoReturn:
    """In the copy: whatever happens, nothing of what its original would do next."""
    code = 1
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)  # a handler would tell the copy alone
        code = work()
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
