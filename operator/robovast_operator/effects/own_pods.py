"""Judges Jobs by our own containers, where admission has added others to their pods."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

from robovast.kubeapi.resources import SHARD_ROLE
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api
from robovast_operator.kube.few_at_once import few_at_once
from robovast_operator.kube.lenient import ranges
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import now
from robovast_operator.memory import Judged, PodsCache
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
"""Shortest time between two readings of a Job's pods [s]."""

MOST = 1000
"""Most pods of a Job that are read."""

_ALIVE = "status.phase!=Failed,status.phase!=Succeeded"


class OwnPods:
    """Corrects what a Job's status says of its pods, and ends pods whose work is done."""

    def __init__(self, api: Api) -> None:
        self._api = api

    async def judge(self, jobs: Mapping[str, JobState], known: PodsCache) -> dict[str, JobState]:
        """Return Jobs with counts and ends as our own containers show them.

        The pods of a Job are read only if some are not ready, or if a task of ours has failed.

        Args:
            jobs: by name.
            known: cache of the Campaign.
        """
        uids = {job.uid for job in jobs.values()}
        known.judged = {uid: found for uid, found in known.judged.items() if uid in uids}
        return {name: await self._judge(job, known) for name, job in jobs.items()}

    async def _judge(self, job: JobState, known: PodsCache) -> JobState:
        waits = job.open and not job.suspended and job.active > job.ready
        lost = job.finished == "Failed" and job.role != SHARD_ROLE
        if job.elsewhere or not (waits or lost):
            return job
        seen = known.judged.get(job.uid)
        if seen is None or seen.finished != job.finished or (waits and _is_old(seen)):
            seen = known.judged[job.uid] = await self._look(job, seen)
        return _corrected(job, seen)

    async def _look(self, job: JobState, before: Judged | None) -> Judged:
        """Read the pods of a Job, only one if nothing is added to that."""
        known = before.reports if before is not None else {}
        seen = Judged(time.monotonic(), job.finished, reports=known)
        if job.open and not any(map(foreign_names, await self._pods(job, 1))):
            return seen
        pods = await self._pods(job, MOST)
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
            reports={**known, **reports_of(filter(has_verdict, pods))},
        )

    async def _pods(self, job: JobState, most: int) -> list[Object]:
        selector = f"batch.kubernetes.io/controller-uid={job.uid}"
        wanted = {"labelSelector": selector, **({"fieldSelector": _ALIVE} if job.open else {})}
        if most == 1:
            wanted["limit"] = "1"
        found: list[Object] = []
        async for pod in self._api.list(paths.pods(job.namespace), **wanted):
            found.append(pod)
            if len(found) >= most:
                break
        return found

    async def _end(self, pod: Object) -> None:
        """End a pod whose work is done.

        The kubelet stops what is left of the pod, and the pod keeps the ends of our containers, so
        its index ends with their verdict (robovast.kubeapi.pod_contract.pods.failure_policy).
        """
        path = f"{paths.pods(pod['metadata']['namespace'])}/{pod['metadata']['name']}"
        await self._api.patch(path, {"spec": {"activeDeadlineSeconds": 1}})


def _is_old(seen: Judged) -> bool:
    return time.monotonic() - seen.at >= LOOK_SECONDS


def _corrected(job: JobState, seen: Judged) -> JobState:
    """A Job as our own containers show it."""
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
