"""Jobs in Kueue's queues: read only while they wait, and started or stopped by Kueue alone."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace

from robovast.kubeapi.status import QueuePlace
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState, Store
from robovast_operator.kube.times import now
from robovast_operator.kube.untrusted_fields import mapping, mappings, text
from robovast_operator.memory import Motion, QueueCache
from robovast_operator.pods.waiting import (
    PARKED,
    QueueFindings,
    Waiting,
    leads_elsewhere,
    no_class,
    place_of,
    waiting_of,
    worker_of,
)
from robovast_operator.settings import OperatorSettings

LOOK_SECONDS = 30.0
"""Time between two readings of a waiting Job [s]: each may cost a write of the status."""
FIRST_SECONDS = 2.0
"""The same while Kueue has not answered yet [s]."""
ANSWER_SECONDS = 10.0
"""How long one answer about a queue serves all campaigns that wait in it [s]."""
QUEUE_SECONDS = 600.0
"""How long the ClusterQueue of a LocalQueue and the served API versions are cached [s]."""
VERSIONS = ("v1beta2", "v1beta1")
"""Versions of Kueue's API, newest first; the fields that are read here are the same in all."""


class Queues:
    """Asks Kueue about the Jobs of campaigns."""

    def __init__(self, api: Api, store: Store, settings: OperatorSettings) -> None:
        self._api = api
        self._store = store
        self._settings = settings
        self._answers: dict[str, tuple[float, Object | None]] = {}

    async def findings(
        self, cache: QueueCache, motion: Motion, jobs: Mapping[str, JobState], *, suspended: bool
    ) -> QueueFindings:
        """Return why a campaign waits in a queue; Kueue is asked when that is due.

        Args:
            cache: of the campaign.
            motion: of its Jobs.
            jobs: its Jobs.
            suspended: whether it is not to run now.
        """
        stalled = motion.still_for() > self._settings.stall_seconds
        held = [job for job in jobs.values() if _is_held(job, stalled=stalled)]
        if suspended:
            again = self._until_parked(cache, held, stalled=stalled)
        elif held:
            again = await self._learn(cache, held[0], stalled=stalled)
        else:
            cache.waiting, cache.job, again = None, (), None
        return QueueFindings(cache.waiting, frozenset(cache.parked), again)

    @staticmethod
    def _until_parked(cache: QueueCache, held: list[JobState], *, stalled: bool) -> float | None:
        cache.waiting = None
        if all(job.name in cache.parked for job in held):
            return None
        return LOOK_SECONDS if stalled else FIRST_SECONDS  # Kueue has not seen it yet

    async def _learn(self, cache: QueueCache, job: JobState, *, stalled: bool) -> float:
        """Ask about a waiting Job, unless that was just done; return when to ask again [s]."""
        moment = time.monotonic()
        if cache.job != (job.uid, job.parallelism):
            cache.job, cache.since = (job.uid, job.parallelism), moment
        elif cache.looked + _pause(cache) > moment:
            return cache.looked + _pause(cache) - moment
        cache.waiting = await self._look(job, cache.waiting, stalled=stalled)
        cache.looked = moment
        if cache.waiting is not None and cache.waiting.parked:
            cache.parked.add(job.name)
        return _pause(cache)

    async def _look(
        self, job: JobState, before: Waiting | None, *, stalled: bool
    ) -> Waiting | None:
        workload = await self._workload(job)
        if workload is None:
            return await self._without_class(job) or _nothing(job, stalled=stalled)
        found = waiting_of(workload, job)
        if found is None or found.helpless or found.parked:
            return found
        place = await self._place(job)
        if place is None:
            return found
        cache = before and before.place
        if cache and cache.summary == place.summary:
            place = cache  # a start that is expected a moment earlier or later is no news
        message = f"The campaign waits in queue {job.queue}, position {place.summary}."
        return replace(found, message=message, place=place)

    async def _without_class(self, job: JobState) -> Waiting | None:
        """Return the finding that Kueue lacks the priority class of the Job, so has no Workload."""
        if not job.priority or not await self._answer(paths.group(paths.KUEUE), QUEUE_SECONDS):
            return None
        path = paths.priority_class(await self._version(paths.KUEUE), job.priority)
        try:
            await self._api.get(path, tries=1)
        except ApiError as error:
            return no_class(job) if error.code == 404 else None
        return None

    async def _place(self, job: JobState) -> QueuePlace | None:
        version = await self._version(paths.KUEUE_VISIBILITY)
        path = paths.pending_workloads(version, job.namespace, job.queue)
        answer = await self._answer(path, ANSWER_SECONDS)
        if answer is None:
            return None
        return place_of(list(mappings(answer.get("items"))), job, await self._running(job), now())

    async def _running(self, waiting: JobState) -> list[JobState]:
        """Return the stored Jobs that have quota of the same ClusterQueue."""
        # Jobs that only look like ours would cost a request for each of their queues.
        own = [
            job
            for key, obj in self._store.campaigns.items()
            for job in self._store.jobs_of(key, obj["metadata"]["uid"]).values()
        ]
        busy = [job for job in own if job.queue and job.open and not job.suspended]
        queue = await self._cluster_queue(waiting)
        return [job for job in busy if await self._cluster_queue(job) == queue]

    async def _cluster_queue(self, job: JobState) -> str:
        version = await self._version(paths.KUEUE)
        path = paths.local_queue(version, job.namespace, job.queue)
        answer = await self._answer(path, QUEUE_SECONDS)
        return text(mapping(mapping(answer).get("spec")).get("clusterQueue"))

    async def _version(self, group: str) -> str:
        """Return the version of Kueue's API to use: the newest that both sides know."""
        answer = await self._answer(paths.group(group), QUEUE_SECONDS)
        served = {text(item.get("version")) for item in mappings(mapping(answer).get("versions"))}
        return next((version for version in VERSIONS if version in served), VERSIONS[-1])

    async def _answer(self, path: str, seconds: float) -> Object | None:
        """Return the object at a path, possibly from the cache; None if the read fails."""
        moment = time.monotonic()
        asked, answer = self._answers.get(path, (-math.inf, None))
        if moment - asked < (seconds if answer else min(seconds, ANSWER_SECONDS)):
            return answer
        try:
            answer = await self._api.get(path, tries=1)
        except ApiError:
            answer = None  # a place in the queue is a courtesy: without it a campaign waits as well
        young = {p: kept for p, kept in self._answers.items() if moment - kept[0] < QUEUE_SECONDS}
        self._answers = {**young, path: (moment, answer)}
        return answer

    async def park(self, job: JobState, cache: QueueCache, *, parked: bool) -> bool:
        """Remove a Job from its queue, or return the Job; False if Kueue does not manage the Job.

        A Job that a user removed from its queue stays removed.
        """
        workload = await self._workload(job)
        if workload is None:
            return bool(job.queue)
        ours = PARKED in (workload["metadata"].get("annotations") or {})
        if ours != parked:
            mark = {"metadata": {"annotations": {PARKED: "true" if parked else None}}}
            version = await self._version(paths.KUEUE)
            name = workload["metadata"]["name"]
            path = f"{paths.workloads(version, job.namespace)}/{name}"
            await self._api.patch(path, {**mark, "spec": {"active": not parked}})
        (cache.parked.add if parked else cache.parked.discard)(job.name)
        cache.job = ()
        return True

    async def worker(self, job: JobState) -> tuple[str, Object | None]:
        """Return the name and the Kueue object of the worker cluster that runs a Job of MultiKueue.

        An operator of single namespaces may not read that, which is the cluster's.
        """
        workload = await self._workload(job)
        name = "" if workload is None else worker_of(workload)
        if not name:
            return "", None
        path = paths.worker_cluster(await self._version(paths.KUEUE), name)
        return name, await self._answer(path, ANSWER_SECONDS)

    async def is_let_in_here(self, job: JobState) -> bool:
        """Return whether a Job of another cluster was admitted for this cluster.

        Nobody makes its pods then: its queue led elsewhere when it was made, and does so no more.
        """
        workload = await self._workload(job)
        return workload is not None and not leads_elsewhere(workload)

    async def _workload(self, job: JobState) -> Object | None:
        """Return Kueue's Workload of a Job."""
        selector = f"kueue.x-k8s.io/job-uid={job.uid}"
        path = paths.workloads(await self._version(paths.KUEUE), job.namespace)
        try:
            found = [item async for item in self._api.list(path, labelSelector=selector)]
        except ApiError as error:
            if error.code == 404:
                return None
            raise
        return found[0] if found else None


def _is_held(job: JobState, *, stalled: bool) -> bool:
    """Return whether a Job waits for quota; a Job without a queue may be resumed at any time."""
    if job.role != "shard" or not job.open or not job.suspended or job.deleting:
        return False
    return bool(job.queue) or stalled


def _pause(cache: QueueCache) -> float:
    waiting = cache.waiting
    clear = waiting is not None and (waiting.helpless or waiting.place is not None)
    new = time.monotonic() - cache.since < LOOK_SECONDS
    return FIRST_SECONDS if new and not clear else LOOK_SECONDS


def _nothing(job: JobState, *, stalled: bool) -> Waiting | None:
    """Return the finding that Kueue has created no Workload."""
    if not job.queue:
        return None
    if not stalled:
        return Waiting(job.name, "Queued", f"The campaign waits in queue {job.queue}.")
    # An operator of single namespaces may not look for classes, which are the cluster's.
    having = f", with a WorkloadPriorityClass {job.priority}" if job.priority else ""
    message = (
        f"Kueue does not admit the Job {job.name} to queue {job.queue}. Check that Kueue is "
        f"installed{having} and manages the namespace {job.namespace}, or remove spec.queueName."
    )
    return Waiting(job.name, "NoKueue", message, helpless=True)
