"""Judges Jobs by our own containers, where admission has added others to their pods."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

from robovast.kubeapi.resources import SHARD_ROLE
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api
from robovast_operator.kube.few_at_once import few_at_once
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import now
from robovast_operator.kube.untrusted_fields import ranges
from robovast_operator.memory import JudgedPods, PodsCache
from robovast_operator.pods.own import (
    ending_of,
    foreign_names,
    has_verdict,
    is_alive,
    is_at_work,
    is_to_be_ended,
    main_ending,
)
from robovast_operator.pods.pod_status import index_of
from robovast_operator.pods.reports import reports_of

LOOK_SECONDS = 10.0
"""Shortest time between two readings of a campaign's pods [s]."""

RARELY = 300.0
"""Longest time between two readings while pods are not ready [s]."""

MOST = 1000
"""Most pods of a Job that are read."""

_UID = "batch.kubernetes.io/controller-uid"
_ALIVE = "status.phase!=Failed,status.phase!=Succeeded"


class OwnPods:
    """Corrects the counts in a Job's status, and stops pods whose work is done."""

    def __init__(self, api: Api) -> None:
        self._api = api

    async def judge(self, jobs: Mapping[str, JobState], cache: PodsCache) -> dict[str, JobState]:
        """Return Jobs with counts and ends as our own containers show them.

        The pods of a campaign are read by one request, and only if some are not ready, or if a
        task of ours has failed.

        Args:
            jobs: by name.
            cache: of the Campaign.
        """
        uids = {job.uid for job in jobs.values()}
        cache.judged = {uid: seen for uid, seen in cache.judged.items() if uid in uids}
        waiting = [job for job in jobs.values() if _waits(job)]
        lost = [job for job in jobs.values() if _is_lost(job)]
        foreign = any(seen.foreign for seen in cache.judged.values())
        pause = pause_of(cache.motion.fruitless_for(), foreign=foreign)
        if waiting and time.monotonic() - cache.judged_at >= pause:
            await self._look(waiting, cache, fieldSelector=_ALIVE)
            cache.judged_at = time.monotonic()
        if new := [job for job in lost if not cache.judged.get(job.uid, JudgedPods()).finished]:
            await self._look(new, cache)
        seen = {job: cache.judged.get(job.uid, JudgedPods()) for job in (*waiting, *lost)}
        cache.foreign = any(seen[job].foreign for job in waiting)
        return {**jobs, **{job.name: _corrected(job, seen[job]) for job in seen}}

    async def _look(self, jobs: Sequence[JobState], cache: PodsCache, **fields: str) -> None:
        """Read the pods of Jobs."""
        pods: dict[str, list[Object]] = {job.uid: [] for job in jobs}
        selector = f"{_UID} in ({','.join(pods)})"
        path = paths.pods(jobs[0].namespace)
        async for pod in self._api.list(path, labelSelector=selector, **fields):
            found = pods.get(pod["metadata"].get("labels", {}).get(_UID), [])
            if len(found) < MOST:
                found.append(pod)
        for job in jobs:
            before = cache.judged.get(job.uid, JudgedPods())
            cache.judged[job.uid] = await self._judged(job, pods[job.uid], before)

    async def _judged(
        self, job: JobState, pods: Sequence[Object], before: JudgedPods
    ) -> JudgedPods:
        """Return the findings of a Job's pods; stop pods whose work is done."""
        seen = JudgedPods(job.finished, reports=before.reports)
        if job.open and not any(map(foreign_names, pods)):
            return seen
        alive = [pod for pod in pods if is_alive(pod)]
        due = [pod for pod in alive if is_to_be_ended(pod, now())]
        await few_at_once(self._end(pod) for pod in due)
        if job.role != SHARD_ROLE:
            done = {index_of(p) for p in pods if ending_of(p, job.role).get("exitCode") == 0}
            return replace(seen, done=frozenset(done), foreign=True)
        return replace(
            seen,
            foreign=True,
            over=sum(bool(main_ending(pod)) for pod in alive),
            at_work=sum(map(is_at_work, alive)),
            reports={**before.reports, **reports_of(filter(has_verdict, pods))},
        )

    async def _end(self, pod: Object) -> None:
        """End a pod whose work is done.

        The kubelet stops what is left of the pod, and the pod keeps the ends of our containers, so
        its index ends with their verdict (robovast.kubeapi.pod_contract.pods.failure_policy).
        """
        path = f"{paths.pods(pod['metadata']['namespace'])}/{pod['metadata']['name']}"
        await self._api.patch(path, {"spec": {"activeDeadlineSeconds": 1}})


def pause_of(fruitless: float, *, foreign: bool) -> float:
    """Return how long the pods of a campaign are not read again [s].

    A pod that others keep alive occupies the place of the next one. So the more such pods there
    are, the sooner no job ends any more.

    Args:
        fruitless: for how long no job has ended [s].
        foreign: whether a pod was found that has foreign containers.
    """
    if foreign:
        return LOOK_SECONDS
    return RARELY if fruitless < LOOK_SECONDS else min(RARELY, max(LOOK_SECONDS, fruitless / 2))


def _waits(job: JobState) -> bool:
    """Return whether pods of a Job are not ready."""
    return job.open and not (job.suspended or job.elsewhere) and job.active > job.ready


def _is_lost(job: JobState) -> bool:
    """Return whether a task of ours has failed, perhaps by a container that is not ours."""
    return job.finished == "Failed" and job.role != SHARD_ROLE and not job.elsewhere


def _corrected(job: JobState, seen: JudgedPods) -> JobState:
    """Return a Job with the state of our own containers."""
    if job.role == SHARD_ROLE:
        if not seen.foreign:
            return job
        active = max(0, job.active - seen.over)
        return replace(job, active=active, ready=min(active, max(seen.at_work, job.ready)))
    spans = ((index, index) for index in seen.done)
    ended = {*spans, *ranges(job.completed, job.size)}
    if seen.done and sum(last - first + 1 for first, last in ended) >= job.size:
        return replace(job, finished="Complete", active=0, ready=0)
    return job
