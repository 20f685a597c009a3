"""The operator as a whole: watch streams fill the store, workers reconcile what has changed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import Coroutine
from typing import Any

from robovast.cluster.resources import MANAGED_BY, MANAGED_LABEL
from robovast_operator import paths
from robovast_operator.api import Api, ApiError, connection_info
from robovast_operator.campaign import Key, Object
from robovast_operator.lease import Leadership
from robovast_operator.metrics import Metrics
from robovast_operator.reconcile import Reconciler
from robovast_operator.serve import serve
from robovast_operator.settings import Settings
from robovast_operator.store import JobState, Store
from robovast_operator.work_queue import WorkQueue, work

LOGGER = logging.getLogger(__name__)

WORKERS = 4


class Operator:
    """Store, queue, workers and the tasks around them."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.store = Store()
        self.queue = WorkQueue()
        self.metrics = Metrics()
        self.api = Api(connection_info(), self.metrics)
        self.leadership = Leadership(self.api, settings)
        self._reconcile = Reconciler(self.api, self.store, self.queue, settings)
        self._tasks: list[asyncio.Task[None]] = []
        self._dead_watch = ""
        self._misses = 0

    async def start(self) -> None:
        """Begin to work."""
        self._spawn(serve(self, self._settings.port))
        self._spawn(self.leadership.keep())
        self._spawn(self._resync())
        for _ in range(WORKERS):
            self._spawn(work(self.queue, self._look))

    async def stop(self) -> None:
        """End work; another replica may go on at once."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        with contextlib.suppress(ApiError, OSError):
            await self.leadership.release()
        await self.api.close()

    def healthy(self) -> str:
        """What is wrong with this process so that it must be started anew; empty when nothing."""
        dead = next((task for task in self._tasks if task.done()), None)
        return f"the task {dead.get_name()} has ended" if dead else self._dead_watch

    def campaign_event(self, kind: str | None, obj: Object) -> None:
        """A Campaign has changed."""
        self.metrics.seen()
        key = (obj["metadata"]["namespace"], obj["metadata"]["name"])
        if kind == "DELETED":
            known = self.store.campaigns.get(key)
            if known is not None and known["metadata"]["uid"] == obj["metadata"]["uid"]:
                del self.store.campaigns[key]
        elif not self.store.put_campaign(obj):
            return
        self.queue.add(key)

    def configuration_event(self, kind: str | None, obj: Object) -> None:
        """A Configuration has changed."""
        self.metrics.seen()
        namespace, name = obj["metadata"]["namespace"], obj["metadata"]["name"]
        if kind == "DELETED":
            self.store.configurations.pop((namespace, name), None)
        else:
            obj["metadata"].pop("managedFields", None)
            self.store.configurations[namespace, name] = obj
        self.queue.add((namespace, str((obj.get("spec") or {}).get("campaign"))))

    def job_event(self, kind: str | None, obj: Object) -> None:
        """A Job has changed."""
        self.metrics.seen()
        job = JobState.of(obj)
        if kind == "DELETED":
            self.store.drop_job(job)
        else:
            self.store.put_job(job)
        self.queue.add(job.key)

    def _spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(coroutine)
        task.set_name(getattr(coroutine, "__qualname__", "task"))
        task.add_done_callback(_log_end)
        self._tasks.append(task)

    async def _look(self, key: Key) -> None:
        await self.leadership.wait()
        with self.metrics.reconciles.time():
            await self._reconcile(key)

    async def _resync(self) -> None:
        """Compare what is known with what is there: a watch that missed something shows."""
        while True:
            await asyncio.sleep(self._settings.resync_seconds * random.uniform(0.9, 1.1))  # noqa: S311
            try:
                await self.compare()
            except (ApiError, OSError) as error:
                LOGGER.warning("the objects cannot be listed: %s", error)

    async def compare(self) -> None:
        """Forget what is gone, learn what was missed, and look at both."""
        spaces = self._settings.namespaces or (None,)
        managed = {"labelSelector": f"{MANAGED_LABEL}={MANAGED_BY}"}
        jobs: dict[tuple[str, str], Object] = {}
        campaigns: dict[tuple[str, str], Object] = {}
        known_jobs = [job for found in self.store.jobs.values() for job in found.values()]
        known_campaigns = list(self.store.campaigns.items())
        for space in spaces:
            async for obj in self.api.list(paths.campaigns(space), resourceVersion="0"):
                campaigns[obj["metadata"]["namespace"], obj["metadata"]["name"]] = obj
            async for obj in self.api.list(paths.jobs(space), resourceVersion="0", **managed):
                jobs[obj["metadata"]["namespace"], obj["metadata"]["name"]] = obj
        for job in known_jobs:
            if (job.namespace, job.name) not in jobs:
                self.store.drop_job(job)
                self.queue.add(job.key)
        for key, known in known_campaigns:
            if key not in campaigns:
                self.campaign_event("DELETED", known)
        self._learn(campaigns, jobs)

    def _learn(self, campaigns: dict[Key, Object], jobs: dict[Key, Object]) -> None:
        missed = []
        for key, obj in campaigns.items():
            if key not in self.store.campaigns:
                missed.append(("Campaigns", obj["metadata"]["uid"]))
                self.campaign_event("ADDED", obj)
        for obj in jobs.values():
            job = JobState.of(obj)
            known = self.store.jobs.get(job.key, {}).get(job.name)
            if known is None or known.uid != job.uid:
                missed.append(("Jobs", job.uid))
                self.job_event("ADDED", obj)
        for kind, uid in missed:
            LOGGER.warning("the watch of %s did not tell of %s", kind, uid)
        self._misses = self._misses + 1 if missed else 0
        if self._misses > 1:  # once may be chance: the list was newer than the stream
            self._dead_watch = f"the watch of {missed[0][0]} is dead"


def _log_end(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        LOGGER.error("the task %s has ended", task.get_name(), exc_info=task.exception())
