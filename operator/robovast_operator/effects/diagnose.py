"""Reads pods: only those of failed indexes, and those of campaigns that make no progress."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from robovast.base.ranges import count
from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.kubeapi.resources import ROLE_LABEL
from robovast.model.packing import pace_of
from robovast_operator.effects.namespace_limits import NamespaceLimitsReader
from robovast_operator.effects.queues import Queues
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.sentences import after_colon, clause
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import now
from robovast_operator.kube.untrusted_fields import mapping, metadata, ranges, text
from robovast_operator.memory import PodsCache
from robovast_operator.planning.campaign import Accepted
from robovast_operator.pods.admission import explain
from robovast_operator.pods.first_failures import mishaps_of
from robovast_operator.pods.observations import MISHAPS, PodFindings, Trouble
from robovast_operator.pods.own import OWN
from robovast_operator.pods.pod_events import (
    DENIALS,
    hook_trouble,
    last_success,
    problem_of_events,
    trouble_of_events,
)
from robovast_operator.pods.pod_status import is_stuck, trouble_of
from robovast_operator.pods.reports import final_of, proposed_of, reports_of, sample_of
from robovast_operator.pods.stalls import RECOVERY, cause_of, may_store, unseen_cause
from robovast_operator.pods.verdicts import Report
from robovast_operator.settings import OperatorSettings

REPORT_SECONDS = 10.0
"""Shortest time between two readings of an open Job's failed pods [s]."""

_FAILED = "status.phase=Failed"
_ENDED = "status.phase!=Running,status.phase!=Pending"
_ALIVE = "status.phase!=Failed,status.phase!=Succeeded"

MEASURED = 32
"""Number of ended packs after which the times of a Job's pods are precise enough."""

MOST = 1000
"""Most pods of a Job that are read when it makes no progress."""

PATIENCE = 4
"""Factor on the stall time while some pods are running: their runs may just be long."""

STORING = "ResultsPending"
STORING_PATIENCE = 900.0
"""How long an agent's pod may still be storing [s]: agents bridge ten minutes without S3."""

GIVEN_UP = frozenset({"PodFailurePolicy", "BackoffLimitExceeded", "DeadlineExceeded"})
"""Reasons of a Job that failed as a whole."""


class Diagnosis:
    """Reads the pods of campaigns, as rarely as possible."""

    def __init__(
        self, api: Api, settings: OperatorSettings, queues: Queues, limits: NamespaceLimitsReader
    ) -> None:
        self._api = api
        self._settings = settings
        self._queues = queues
        self._limits = limits

    async def findings(
        self, accepted: Accepted, cache: PodsCache, jobs: Mapping[str, JobState]
    ) -> PodFindings:
        """Return what the campaign's pods report; they are read only when that is due."""
        moved = cache.motion.notice(jobs)
        all_report = accepted.as_needed
        waits = [await self._reports(cache, job, all_report) for job in jobs.values()]
        if accepted.spec.suspend or _has_success(cache, jobs):
            cache.trouble = cache.deadly = None
        if moved:
            cache.stuck.clear()
            if any(job.ready for job in jobs.values() if job.open):
                cache.trouble = None
        for job in jobs.values():
            await self._final(cache, job)
            if accepted.vast.execution.packs_are_measured:
                await self._measure(cache, job)
        waits.append(await self._stalled(accepted, cache, jobs))
        cache.mishaps = {name: found for name, found in cache.mishaps.items() if name in jobs}
        cache.samples = {name: found for name, found in cache.samples.items() if name in jobs}
        given_up = cache.given_up
        return PodFindings(
            reports=_reports(cache, jobs),
            finals=dict(cache.finals),
            proposals=dict(cache.proposals),
            pace=pace_of(sample for _, found in cache.samples.values() for sample in found),
            mishaps=list(chain.from_iterable(cache.mishaps.values()))[:MISHAPS],
            failures={n: given_up[job.uid] for n, job in jobs.items() if job.uid in given_up},
            stuck=frozenset(cache.stuck),
            trouble=cache.trouble or cache.deadly,
            again=min((wait for wait in waits if wait is not None), default=None),
        )

    def pods_of(self, job: JobState, **parameters: str) -> AsyncIterator[Object]:
        """Return the pods of a Job."""
        selector = f"batch.kubernetes.io/controller-uid={job.uid}"
        return self._api.list(paths.pods(job.namespace), labelSelector=selector, **parameters)

    async def storing(self, identity: Identity, beside: Collection[str] = ()) -> str:
        """Return the name of a pod that may still store runs, also of a deleted Job; else empty.

        Args:
            identity: of the Campaign.
            beside: Jobs whose pods may store runs.
        """
        pods = self._api.list(
            paths.pods(identity.namespace),
            labelSelector=identity.selector(**{ROLE_LABEL: "shard"}),
            fieldSelector=_ALIVE,
        )
        found = [
            pod["metadata"]["name"]
            async for pod in pods
            if may_store(pod, now()) and _job_of(pod) not in beside
        ]
        return min(found, default="")

    async def hold_back(
        self, identity: Identity, cache: PodsCache, beside: Collection[str] = ()
    ) -> bool:
        """Return whether a task must wait for a pod of a finished Job; report a long wait."""
        pod = await self.storing(identity, beside)
        if pod and cache.motion.still_for() > STORING_PATIENCE:
            logs = f"kubectl logs -n {identity.namespace} {pod} -c agent"
            message = (
                f"All Jobs have finished, but pod {pod} may still store results, so the index "
                f"waits for the pod. Read the log with `{logs}`, or delete the pod."
            )
            cache.trouble = Trouble(STORING, message)
        return bool(pod)

    async def _reports(self, cache: PodsCache, job: JobState, all_report: bool) -> float | None:
        """Return the verdicts of failed indexes.

        Args:
            cache: of the Campaign.
            job: the Job.
            all_report: whether pods of completed indexes are also read: they report how many runs
                they did not need.
        """
        ended = [job.failed, job.completed] if all_report else [job.failed]
        mark = " ".join([job.uid, *ended])
        before, _ = cache.reports.get(job.name, ("", {}))
        if job.role != "shard" or not any(ended) or before == mark:
            return None
        wait = cache.looked + REPORT_SECONDS - time.monotonic()
        if job.open and before and wait > 0:
            return wait
        phase = _ENDED if all_report else _FAILED
        pods = [pod async for pod in self.pods_of(job, fieldSelector=phase)]
        cache.reports[job.name] = (mark, reports_of(pods))
        cache.mishaps[job.name] = mishaps_of(pods)
        cache.looked = time.monotonic()
        return None

    async def _measure(self, cache: PodsCache, job: JobState) -> None:
        """Return what the pods of a Job took, each time that twice as many have ended."""
        ended = job.size - job.left
        before, _ = cache.samples.get(job.name, (0, []))
        if job.role != "shard" or ended < max(1, 2 * before) or before >= MEASURED:
            return
        over = self.pods_of(job, fieldSelector=_ENDED)
        read = [sample_of(pod) async for pod in _first(over)]
        found = [sample for sample in read if sample is not None]
        cache.samples[job.name] = (ended, found[: 2 * MEASURED])

    async def _final(self, cache: PodsCache, job: JobState) -> None:
        """Return termination messages of ended Jobs: what they found, or why they failed."""
        if job.role == "finish" and job.finished == "Complete" and job.name not in cache.finals:
            final = final_of([pod async for pod in self.pods_of(job)])
            if final is not None:
                cache.finals[job.name] = final
        if job.role == "propose" and job.finished == "Complete" and job.name not in cache.proposals:
            proposed = proposed_of([pod async for pod in self.pods_of(job)])
            if isinstance(proposed, Proposed):
                cache.proposals[job.name] = proposed
        if job.finished != "Failed" or job.reason not in GIVEN_UP:
            return
        if job.uid not in cache.given_up:
            pods = [pod async for pod in self.pods_of(job)]
            found = trouble_of(pods) or Trouble(
                job.reason,
                f"Job {job.name} failed{after_colon(job.message)}. Inspect the Job with `kubectl "
                f"describe job -n {job.namespace} {job.name}`.",
            )
            cache.given_up[job.uid] = Trouble(found.reason, found.message, final=True)
        trouble = cache.given_up[job.uid]
        if job.role in {"shard", "propose"}:
            cache.trouble = trouble
        elif job.role != "process":  # without tables a campaign is complete all the same
            cache.deadly = replace(trouble, final=False)

    async def _stalled(
        self, accepted: Accepted, cache: PodsCache, jobs: Mapping[str, JobState]
    ) -> float | None:
        """Find out why the campaign makes no progress; return when to look again [s]."""
        waiting = [job for job in jobs.values() if job.open and not job.suspended]
        if not waiting or accepted.spec.suspend or (cache.trouble and cache.trouble.final):
            return None
        at_work = any(job.ready for job in waiting if not job.elsewhere)
        limit = self._settings.stall_seconds
        # Running pods may have long runs, or die one after the other.
        quiet, least = cache.motion.still_for(), limit
        if at_work:
            quiet, least = cache.motion.fruitless_for(), PATIENCE * limit
        pause = min(300.0, max(limit, quiet / 2))
        wait = least - quiet
        if at_work or cache.diagnosed > cache.motion.moved:
            wait = max(wait, cache.diagnosed + pause - time.monotonic())
        if wait > 0:
            return wait
        cache.diagnosed = time.monotonic()
        found: Trouble | None = None
        for job in waiting:
            found = found or await self._look_at_pods(cache, job, at_work=at_work)
        cache.trouble = found
        if found and found.deadly:
            cache.deadly = found
        elif at_work and cache.motion.still_for() > RECOVERY.total_seconds():
            cache.deadly = None
        return pause

    async def _look_at_pods(
        self, cache: PodsCache, job: JobState, *, at_work: bool
    ) -> Trouble | None:
        """Find in pods and Events why a Job makes no progress."""
        if job.elsewhere:
            if await self._queues.is_let_in_here(job):
                cache.stuck.add(job.name)
            return unseen_cause(job, *await self._queues.worker(job))
        phase = _FAILED if at_work else "status.phase!=Succeeded"
        seen = [pod async for pod in _first(self.pods_of(job, fieldSelector=phase))]
        if any(is_stuck(pod, now()) for pod in seen):
            cache.stuck.add(job.name)
        silence = self._settings.silence_minutes * 60
        found = cause_of(seen, job, now(), silence, at_work=at_work)
        pending = [pod for pod in seen if pod["status"].get("phase") == "Pending"]
        if found or at_work or (job.active and not pending):
            return found
        return await self._trouble_of_events(job, seen, pending)

    async def _trouble_of_events(
        self, job: JobState, seen: Sequence[Object], pending: Sequence[Object]
    ) -> Trouble | None:
        """Find in Events of the oldest pending pod, or of the Job, why no pod starts."""
        oldest = min(pending, key=last_success, default=None)
        uid = oldest["metadata"]["uid"] if oldest else job.uid
        found = self._api.list(
            paths.events(job.namespace), fieldSelector=f"involvedObject.uid={uid}"
        )
        events = [event async for event in _first(found)]
        if oldest:
            return hook_trouble(oldest, events) or trouble_of_events(events, last_success(oldest))
        last_progress = last_success(*seen, since=job.started)
        problem = problem_of_events(events, last_progress)
        if problem is None or problem[0] not in DENIALS:
            return trouble_of_events(events, last_progress)
        reason, refusal = problem
        return Trouble(reason, await self._explained(job, refusal))

    async def _explained(self, job: JobState, refusal: str) -> str:
        """Explain the refusal of a Job's pods by the quotas and limits of its namespace."""
        named = {"fieldSelector": f"metadata.name={job.name}"}
        async for obj in self._api.list(paths.jobs(job.namespace), **named):
            pod = mapping(mapping(mapping(obj.get("spec")).get("template")).get("spec"))
            why = explain(refusal, pod, await self._limits.read(job.namespace), OWN)
            if why:
                return f"{why} Message of the API server: {clause(refusal)}."
        return (
            f"The API server rejects the pods of the Job {job.name}: {clause(refusal)}. Ask your "
            "cluster administrator."
        )


def _reports(cache: PodsCache, jobs: Mapping[str, JobState]) -> dict[str, Mapping[int, Report]]:
    """Return the reports of a campaign's pods; reports that were read later take precedence."""
    stored = {n: cache.judged[j.uid].reports for n, j in jobs.items() if j.uid in cache.judged}
    read = {name: reports for name, (_, reports) in cache.reports.items()}
    return {name: {**stored.get(name, {}), **read.get(name, {})} for name in {*stored, *read}}


def _has_success(cache: PodsCache, jobs: Mapping[str, JobState]) -> bool:
    """Return whether more indexes are complete, or more verdicts exist, than at the last call."""
    before, reports = cache.successes, _reports(cache, jobs)
    cache.successes = {
        job.uid: count(ranges(job.completed, job.size))
        + (job.finished == "Complete")
        + sum(report.settled > 0 for report in reports.get(name, {}).values())
        for name, job in jobs.items()
    }
    return any(number > before.get(uid, 0) for uid, number in cache.successes.items())


async def _first(objects: AsyncIterator[Object]) -> AsyncIterator[Object]:
    count = 0
    async for obj in objects:
        yield obj
        count += 1
        if count >= MOST:
            return


def _job_of(pod: Object) -> str:
    """Return the name of a pod's Job."""
    return text(mapping(metadata(pod).get("labels")).get("batch.kubernetes.io/job-name"))
