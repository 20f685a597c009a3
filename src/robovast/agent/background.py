"""Threads that store what a job leaves while the job is watched: results, and next to them logs."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from types import TracebackType


class Background:
    """A thread that executes tasks in order; as a context manager it ends when all are done.

    A second thread executes tasks that no other task waits for.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="store")
        self._side_pool = ThreadPoolExecutor(1, thread_name_prefix="logs")
        self._futures: list[Future[None]] = []
        self._side: Future[None] | None = None
        self._is_over = False

    def __enter__(self) -> Background:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        self._is_over = True
        self._side_pool.shutdown(wait=False, cancel_futures=True)
        self._pool.shutdown(cancel_futures=kind is not None)
        self.wait_for_side()
        if kind is None:
            self.check()

    def do(self, action: Callable[[], None]) -> None:
        """Execute a task after all earlier ones."""
        self._futures.append(self._pool.submit(action))

    def do_aside(self, action: Callable[[], None]) -> None:
        """Execute a task next to the others, unless the last one of this kind has not ended."""
        if self._side is None or self._side.done():
            self._side = self._side_pool.submit(action)

    def is_busy(self) -> bool:
        """Whether a task waits or runs that goes before those next to it."""
        return self._is_over or not all(future.done() for future in list(self._futures))

    def wait_for_side(self) -> None:
        """Wait for the task next to the others; raise no exception of it."""
        if self._side is not None:
            wait([self._side])

    def check(self) -> None:
        """Raise the exception of a task that failed."""
        while self._futures and self._futures[0].done():
            self._futures.pop(0).result()

    def wait(self) -> None:
        """Wait until all tasks are done; raise the exception of one that failed."""
        while self._futures:
            self._futures.pop(0).result()
