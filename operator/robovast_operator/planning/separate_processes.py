"""Runs functions on users' input in separate processes, with bounds on time and memory.

Nothing waits for a process: a call returns a future. There are two processes at a time at most. One
begins every call and soon stops it, the other one then repeats the few calls that need more. So a
small document waits a second for each other namespace, however heavy the documents of those are.
If a process dies, only the Campaign that it worked for is affected.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
import time
from asyncio import Future
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from robovast.base.errors import InputError, with_hint
from robovast_operator.kube.rotation import Rotation

P = ParamSpec("P")
R = TypeVar("R")

_CONTEXT = get_context("forkserver")
_CONTEXT.set_forkserver_preload(["__main__", "robovast_operator.planning.additions"])


@dataclass(frozen=True)
class Bounds:
    """Bounds of a call."""

    seconds: float
    """Time that a call may take."""
    memory: int
    """Memory that a call may take in addition to what its process starts with [byte]."""
    niceness: int = 0


BRIEF = Bounds(1.0, 64 * 2**20)
LONG = Bounds(20.0, 256 * 2**20, niceness=10)

START_SECONDS = 60.0
"""Time limit for the start of a process, which the time of its call does not include."""
FIRST_DELAY = 10.0
LONGEST_DELAY = 300.0
"""Longest delay after calls that were stopped [s]."""


class TooLargeError(InputError):
    """A call exceeded its bounds."""


@dataclass(frozen=True, eq=False)
class _Call:
    """A call that was asked for."""

    who: tuple[str, ...]
    function: Callable[[], Any]
    future: Future[Any]


@dataclass
class _Delay:
    """How long the next call of an object is delayed, whose last ones were stopped."""

    seconds: float = 0.0
    ends: float = 0.0


@dataclass(eq=False)
class _Lane:
    """Calls with the same bounds, of which one at a time runs."""

    bounds: Bounds
    waiting: Rotation[_Call] = field(default_factory=Rotation)
    task: asyncio.Task[None] | None = None


class Apart:
    """Calls functions in separate processes; namespaces take turns."""

    def __init__(self, brief: Bounds = BRIEF, long: Bounds = LONG) -> None:
        """Set the bounds of the first and of the second attempt of a call."""
        self._brief = _Lane(brief)
        self._long = _Lane(long)
        self._delays: dict[tuple[str, ...], _Delay] = {}
        """By object: the delay after its last call, which was stopped."""

    def submit(
        self, who: tuple[str, ...], function: Callable[P, R], *args: P.args, **kwargs: P.kwargs
    ) -> Future[R]:
        """Call a function when the turn of its namespace comes.

        Args:
            who: the object that the function works for; the first part is its namespace.
            function: to be called in another process, like all arguments.
            args: its arguments.
            kwargs: its arguments.

        Returns:
            What the function returns or raises; `TooLargeError` if it took too much memory or time,
            or its process died. Cancel the future to stop the call.
        """
        loop = asyncio.get_running_loop()
        future: Future[R] = loop.create_future()
        future.add_done_callback(lambda it: it.cancelled() or it.exception())  # seen by its owner
        call = _Call(who, partial(function, *args, **kwargs), future)
        delay = self._delays.get(who)
        wait = delay.ends - time.monotonic() if delay is not None else 0.0
        if wait > 0:
            loop.call_later(wait, self._enter, self._brief, call)
        else:
            self._enter(self._brief, call)
        return future

    def _enter(self, lane: _Lane, call: _Call) -> None:
        lane.waiting.add(call.who[0], call)
        if lane.task is None:
            lane.task = asyncio.create_task(self._work(lane))

    async def _work(self, lane: _Lane) -> None:
        """Run the calls of a lane until no call waits."""
        try:
            while (call := lane.waiting.take()) is not None:
                if not call.future.done():
                    await self._attempt(lane, call)
        finally:
            lane.task = None

    async def _attempt(self, lane: _Lane, call: _Call) -> None:
        process = _Process(call.function, lane.bounds)
        call.future.add_done_callback(lambda _: process.end())
        try:
            good, result = await asyncio.to_thread(process.answer)
        except Exception as error:
            good, result = False, error
        finally:
            process.end()
        if call.future.done():
            return
        if isinstance(result, TooLargeError):
            if lane is self._brief:
                self._enter(self._long, call)
                return
            result = self._delayed(call.who, result)
        else:
            self._delays.pop(call.who, None)
        if good:
            call.future.set_result(result)
        else:
            call.future.set_exception(result)

    def _delayed(self, who: tuple[str, ...], error: TooLargeError) -> TooLargeError:
        """Delay the next call of an object whose call was stopped, each time longer."""
        now = time.monotonic()
        kept = {k: d for k, d in self._delays.items() if d.ends + LONGEST_DELAY > now}
        seconds = min(LONGEST_DELAY, 2 * kept[who].seconds if who in kept else FIRST_DELAY)
        self._delays = {**kept, who: _Delay(seconds, now + seconds)}
        return TooLargeError(
            error.message,
            hint=with_hint(
                error.hint, f"the operator checks a change after {seconds:g} s at the earliest"
            ),
        )


class _Process:
    """A process that makes one call."""

    def __init__(self, function: Callable[[], Any], bounds: Bounds) -> None:
        self._receiver, self._sender = _CONTEXT.Pipe(duplex=False)
        self._seconds = bounds.seconds
        self._process = _CONTEXT.Process(
            target=_work, args=(self._sender, bounds, function), daemon=True
        )

    def answer(self) -> tuple[bool, Any]:
        """Wait for the function; return whether it returned, and the result or the exception.

        Raises:
            TooLargeError: it took too much memory or time, or its process died.
        """
        try:
            self._process.start()
        except RecursionError:
            raise InputError(
                "The field spec.vast is nested too deeply", hint="simplify the .vast file"
            ) from None
        self._sender.close()
        try:
            self._receive(START_SECONDS)
            found: tuple[bool, Any] = self._receive(self._seconds)
        except EOFError:
            raise TooLargeError(
                "The process that expands the .vast file ended, probably for lack of memory",
                hint=_SMALLER,
            ) from None
        finally:
            self.end()
            self._process.join()
            self._receiver.close()
        return found

    def _receive(self, seconds: float) -> Any:
        if not self._receiver.poll(seconds):
            raise TooLargeError(
                f"The expansion of the .vast file takes longer than {seconds:g} s", hint=_SMALLER
            )
        return self._receiver.recv()

    def end(self) -> None:
        """Stop the process, which ends `answer`."""
        if self._process.is_alive():
            self._process.kill()


_SMALLER = "use fewer or smaller values, or split the .vast file into several Campaigns"


def _work(sender: Connection, bounds: Bounds, function: Callable[[], object]) -> None:
    try:
        sender.send("begun")
    except BrokenPipeError:  # the call was stopped before it started
        return
    os.nice(bounds.niceness)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
        file.write("1000")  # when the container has no room, it goes, and not the operator
    with open("/proc/self/statm", encoding="ascii") as file:
        begun = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (begun + bounds.memory, resource.RLIM_INFINITY))
    try:
        answer: tuple[bool, object] = True, function()
    except MemoryError:
        answer = (
            False,
            TooLargeError(
                f"The expansion of the .vast file needs more than {bounds.memory >> 20} MiB",
                hint=_SMALLER,
            ),
        )
    except Exception as error:
        answer = False, error
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    with contextlib.suppress(BrokenPipeError):  # the operator was killed
        sender.send(answer)
