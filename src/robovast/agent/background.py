"""A thread that executes tasks in order while a job is watched."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType


class Background:
    """A thread that executes tasks; as a context manager it ends when all are done."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="store")
        self._futures: list[Future[None]] = []

    def __enter__(self) -> Background:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(cancel_futures=kind is not None)
        if kind is None:
            self.check()

    def do(self, action: Callable[[], None]) -> None:
        """Execute a task after all earlier ones."""
        self._futures.append(self._pool.submit(action))

    def check(self) -> None:
        """Raise the exception of a task that failed."""
        while self._futures and self._futures[0].done():
            self._futures.pop(0).result()

    def wait(self) -> None:
        """Wait until all tasks are done; raise the exception of one that failed."""
        while self._futures:
            self._futures.pop(0).result()
