"""The operator as a whole: watch streams fill the store, workers reconcile what has changed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Coroutine
from contextvars import ContextVar
from functools import partial
from typing import Any

from robovast.kubeapi.resources import MANAGED_BY, MANAGED_LABEL
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError, connect
from robovast_operator.kube.lease import Leadership
from robovast_operator.kube.metrics import Metrics
from robovast_operator.kube.objects import Key, Object
from robovast_operator.kube.resync import Resync, WatchedKind
from robovast_operator.kube.serve import serve
from robovast_operator.kube.store import Id, JobState, Store, campaign_of, id_of
from robovast_operator.kube.work_queue import WORKERS, WorkQueue, work
from robovast_operator.reconcile import Reconciler
from robovast_operator.settings import OperatorSettings

LOGGER = logging.getLogger(__name__)

ALONE_SECONDS = 1.0
"""A Configuration without its Campaign waits so long [s]: both may be applied together."""

_TERM: ContextVar[int] = ContextVar("term")
"""Term of leadership in which the current reconcile began; later its writes are refused."""


class Operator:
    """The store, the queue, the workers and their background tasks."""

    def __init__(self, settings: OperatorSettings) -> None:
        self._settings = settings
        self.store = Store()
        self.queue = WorkQueue()
        self.metrics = Metrics()
        self._lease_api = Api(connect(), self.metrics)
        self.leadership = Leadership(self._lease_api, settings)
        self.api = Api(connect(), self.metrics, may_write=self._may_write)
        self._reconcile = Reconciler(self.api, self.store, self.queue, settings, self.metrics)
        self._term = 0
        """Term of leadership in which the reconciler filled its caches."""
        self._tasks: list[asyncio.Task[None]] = []
        self._resync = Resync(self.api, settings, self._kinds())

    async def start(self) -> None:
        """Start all tasks."""
        self._spawn(serve(self._settings.port, self.healthy, self.ready, self._metrics_page))
        self._spawn(self.leadership.keep())
        self._spawn(self._resync.keep())
        for _ in range(WORKERS):
            self._spawn(work(self.queue, self._look))

    async def can_stream_lists(self) -> bool:
        """Return whether this server lets watches begin with the existing objects."""
        space = next(iter(self._settings.namespaces), None)
        return await self.api.can_stream_lists(paths.configurations(space))

    async def stop(self) -> None:
        """Stop all tasks; another replica may continue at once."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        with contextlib.suppress(ApiError, OSError):
            await self.leadership.release()
        await self._lease_api.close()
        await self.api.close()

    def _metrics_page(self) -> bytes:
        found = self.leadership
        blocked = bool(found.rival or found.failure)
        return self.metrics.page(self.store, self.queue, leading=found.leading, blocked=blocked)

    def healthy(self) -> str:
        """Return why this process must be restarted; empty if the process is healthy."""
        dead = next((task for task in self._tasks if task.done()), None)
        return f"the task {dead.get_name()} has ended" if dead else self._resync.dead_watch

    def ready(self) -> str:
        """Return why campaigns cannot be reconciled, by any replica; empty if they can."""
        unknown = (
            "" if self._resync.complete.is_set() else ("the existing objects are not listed yet")
        )
        return self.healthy() or self.leadership.failure or self.leadership.rival or unknown

    def campaign_event(self, kind: str | None, obj: Object) -> None:
        """Store a changed Campaign and schedule a reconcile."""
        self._heard(kind)
        if kind == "DELETED":
            self._forget_campaign(id_of(obj))
        elif self.store.put_campaign(obj):
            self.queue.add(id_of(obj)[:2])

    def configuration_event(self, kind: str | None, obj: Object) -> None:
        """Store a changed Configuration and schedule a reconcile of its Campaign."""
        self._heard(kind)
        if kind == "DELETED":
            self._forget_configuration(id_of(obj))
        elif self.store.put_configuration(obj):
            key = campaign_of(obj)
            self.queue.add(key, 0.0 if key in self.store.campaigns else ALONE_SECONDS)

    def job_event(self, kind: str | None, obj: Object) -> None:
        """Store a changed Job and schedule a reconcile of its Campaign."""
        self._heard(kind)
        if kind == "DELETED":
            self._forget_job(id_of(obj))
        else:
            job = JobState.of(obj)
            self.store.put_job(job)
            self.queue.add(job.key)

    def _heard(self, kind: str | None) -> None:
        self.metrics.seen()
        if kind is None:
            self._resync.listed()

    def _forget_campaign(self, id_: Id) -> None:
        if self.store.drop_campaign(id_) is not None:
            self.queue.add(id_[:2])

    def _forget_configuration(self, id_: Id) -> None:
        dropped = self.store.drop_configuration(id_)
        if dropped is not None:
            self.queue.add(campaign_of(dropped))

    def _forget_job(self, id_: Id) -> None:
        key = self.store.drop_job(id_)
        if key is not None:
            self.queue.add(key)

    def _spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(coroutine)
        task.set_name(getattr(coroutine, "__qualname__", "task"))
        task.add_done_callback(_log_end)
        self._tasks.append(task)

    def _may_write(self) -> bool:
        """Return whether this replica leads, in the term in which the current reconcile began."""
        return self.leadership.leading and _TERM.get(self.leadership.term) == self.leadership.term

    async def _look(self, key: Key) -> None:
        await self.leadership.wait()
        await self._resync.complete.wait()
        _TERM.set(self.leadership.term)
        if self._term != self.leadership.term:
            self._term = self.leadership.term
            self._reconcile.forget()
        with self.metrics.reconciles.time():
            await self._reconcile(key)

    def _kinds(self) -> tuple[WatchedKind, ...]:
        """Return the watched kinds, for the periodic comparison."""
        return (
            WatchedKind(
                "Campaigns",
                paths.campaigns,
                self.store.campaign_versions,
                self.store.has_campaign,
                partial(self.campaign_event, "MODIFIED"),
                self._forget_campaign,
            ),
            WatchedKind(
                "Configurations",
                paths.configurations,
                self.store.configuration_versions,
                self.store.has_configuration,
                partial(self.configuration_event, "MODIFIED"),
                self._forget_configuration,
            ),
            WatchedKind(
                "Jobs",
                paths.jobs,
                self.store.job_versions,
                self.store.has_job,
                partial(self.job_event, "MODIFIED"),
                self._forget_job,
                {"labelSelector": f"{MANAGED_LABEL}={MANAGED_BY}"},
            ),
        )


def _log_end(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        LOGGER.error("the task %s has ended", task.get_name(), exc_info=task.exception())
