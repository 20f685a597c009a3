"""Runs work on users' input in a separate process, with bounds on time and memory.

One at a time. If such a process dies, only the Campaign that it worked for is affected.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
from collections.abc import Callable
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock
from typing import ParamSpec, TypeVar

from robovast.base.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

MEMORY = 256 * 2**20
"""Memory that a call may take beyond what the process starts with [byte]."""
SECONDS = 120.0
"""Time that a call may take."""

_CONTEXT = get_context("forkserver")
_CONTEXT.set_forkserver_preload(["__main__", "robovast_operator.planning.additions"])


class Apart:
    """Calls functions in separate processes, one after another."""

    def __init__(self, memory: int = MEMORY, seconds: float = SECONDS) -> None:
        """Set the bounds.

        Args:
            memory: most memory of a call beside what a process begins with [byte].
            seconds: most time of a call.
        """
        self._memory = memory
        self._seconds = seconds
        self._turn = Lock()

    async def __call__(self, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Return what the function returns, or raise what it raises.

        Raises:
            InputError: it took too much memory or time, or its process died.
        """
        return await asyncio.to_thread(partial(self.call, function, *args, **kwargs))

    def call(self, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """The same, called from a thread.

        Raises:
            InputError: it took too much memory or time, or its process died.
        """
        with self._turn:
            return self._call(function, args, kwargs)

    def _call(self, function: Callable[..., R], args: object, kwargs: object) -> R:
        receiver, sender = _CONTEXT.Pipe(duplex=False)
        process = _CONTEXT.Process(
            target=_work, args=(sender, self._memory, function, args, kwargs), daemon=True
        )
        try:
            process.start()
        except RecursionError:
            raise InputError("spec.vast is nested too deeply to be a document.") from None
        sender.close()
        try:
            if not receiver.poll(self._seconds):
                raise InputError(f"{_TOO_MUCH} (it takes longer than {self._seconds:g} s).")
            good, result = receiver.recv()
        except EOFError:
            raise InputError(f"{_TOO_MUCH} (its process died: out of memory?).") from None
        finally:
            receiver.close()
            process.kill()
            process.join()
        if not good:
            raise result
        found: R = result
        return found


_TOO_MUCH = (
    "the document needs more than the operator spends on one. Give fewer or smaller values, or "
    "divide it into several Campaigns"
)


def _work(
    sender: Connection, memory: int, function: Callable[..., object], args: tuple[object, ...],
    kwargs: dict[str, object],
) -> None:  # fmt: skip
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
        file.write("1000")  # when the container has no room, it goes, and not the operator
    with open("/proc/self/statm", encoding="ascii") as file:
        begun = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (begun + memory, resource.RLIM_INFINITY))
    try:
        answer: tuple[bool, object] = True, function(*args, **kwargs)
    except MemoryError:
        answer = False, InputError(f"{_TOO_MUCH} (it takes more than {memory >> 20} MiB).")
    except Exception as error:
        answer = False, error
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    with contextlib.suppress(BrokenPipeError):  # whoever asked was killed
        sender.send(answer)
