"""Several parallel plugin processes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from queue import SimpleQueue
from typing import IO, TypeVar

from robovast.analysis.postprocessing.worker import PluginWorker, StoppedError
from robovast.base.signals import call_on_signals

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


class Workers:
    """A fixed number of workers; each starts when it is first needed."""

    def __init__(self, workers: Sequence[PluginWorker], stopped: threading.Event) -> None:
        self._count = len(workers)
        self._stopped = stopped
        self._idle: SimpleQueue[PluginWorker] = SimpleQueue()
        for worker in workers:
            self._idle.put(worker)

    @contextmanager
    def one(self) -> Iterator[PluginWorker]:
        """A worker for exclusive use."""
        worker = self._idle.get()
        try:
            yield worker
        finally:
            self._idle.put(worker)

    def map(
        self, work: Callable[[PluginWorker, ItemT], ResultT], items: Sequence[ItemT]
    ) -> Iterator[ResultT]:
        """Results of `work` for each item, in order of completion.

        Raises:
            StoppedError: the user asked to stop; available results were returned before.
        """

        def one(item: ItemT) -> ResultT:
            with self.one() as worker:
                return work(worker, item)

        pool = ThreadPoolExecutor(self._count)
        try:
            futures = [pool.submit(one, item) for item in items]
            stopped = False
            for future in as_completed(futures):
                try:
                    yield future.result()
                except StoppedError:
                    stopped = True
            if stopped:
                raise StoppedError
        except BaseException:
            self._stopped.set()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def started(count: int, log: IO[bytes], time_limit: float) -> Iterator[Workers]:
    """Workers that stop on SIGINT, SIGTERM and SIGHUP.

    Args:
        count: number of workers.
        log: destination of the plugins' output.
        time_limit: time limit for one call [s].
    """
    stopped = threading.Event()
    with ExitStack() as stack:
        workers = [PluginWorker(log, time_limit, stopped) for _ in range(count)]
        for worker in workers:
            stack.enter_context(worker)
        stack.enter_context(call_on_signals(stopped.set))
        yield Workers(workers, stopped)
