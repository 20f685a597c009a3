"""Delete a campaign's bucket together with the Campaign, if the spec requests that."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from robovast_operator.effects.diagnose import Diagnosis
from robovast_operator.effects.inputs import Begun
from robovast_operator.effects.jobs import Jobs
from robovast_operator.kube import paths
from robovast_operator.kube.announce import announce
from robovast_operator.kube.api import Api
from robovast_operator.kube.events import EventContent
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.sentences import clause, sentence
from robovast_operator.kube.store import JobState
from robovast_operator.planning.campaign import Rejected
from robovast_operator.pods.jobs import plan_config_map, task_job
from robovast_operator.pods.pod_status import trouble_of
from robovast_operator.settings import OperatorSettings

LOGGER = logging.getLogger(__name__)

FINALIZER = "robovast.io/purge"


class Purge:
    """The finalizer of `retention: Delete`; every other Campaign has none."""

    def __init__(
        self, api: Api, settings: OperatorSettings, diagnosis: Diagnosis, jobs: Jobs
    ) -> None:
        self._api = api
        self._jobs = jobs
        self._settings = settings
        self._diagnosis = diagnosis

    @staticmethod
    def holds(obj: Object) -> bool:
        """Return whether a Campaign has the finalizer, so that the bucket is deleted first."""
        return FINALIZER in (obj["metadata"].get("finalizers") or ())

    async def protect(self, obj: Object) -> None:
        """Add or remove the finalizer according to the spec.

        This comes before the first pod that could make a bucket, and not earlier: a Campaign that
        was never accepted goes at once.
        """
        storage = (obj.get("spec") or {}).get("storage") or {}
        finalizers = list(obj["metadata"].get("finalizers") or ())
        wanted = storage.get("retention") == "Delete"
        if wanted != (FINALIZER in finalizers):
            others = [name for name in finalizers if name != FINALIZER]
            await self._set(obj, [*others, FINALIZER] if wanted else others)

    async def carry_out(
        self, obj: Object, begun: Begun | Rejected, jobs: Mapping[str, JobState]
    ) -> float | None:
        """Take the next step of removing a bucket; return when to reconcile again [s].

        Nothing that the Campaign was made from is needed: all of it may go before it does.
        """
        others = [name for name in obj["metadata"]["finalizers"] if name != FINALIZER]
        if isinstance(begun, Rejected):
            if (obj.get("status") or {}).get("bucket"):
                await self._report_waiting(obj, begun.message)
                return 300.0
            await self._set(obj, others)  # it never had a bucket
            return None
        accepted, where = begun
        name = accepted.identity.child("purge")
        job = jobs.get(name)
        if job is not None and job.finished == "Complete":
            await self._set(obj, others)
            return None
        if job is not None and job.finished:
            await self._report_waiting(obj, await self._cause(job))
            return 300.0
        if await self._end_others(jobs, name):
            return 2.0  # pods that still store results would create the bucket again
        plan = accepted.identity.child("plan-purge")
        config_map = plan_config_map(accepted, plan, where)
        await self._api.create(paths.config_maps(config_map["metadata"]["namespace"]), config_map)
        if job is None:
            made = task_job(accepted, self._settings, "purge", name, plan)
            await self._jobs.create(made)
        return 15.0

    async def _end_others(self, jobs: Mapping[str, JobState], own: str) -> bool:
        """Delete all Jobs but the purge Job; return whether any still exists."""
        others = [job for job in jobs.values() if job.name != own]
        for job in others:
            if not job.deleting:
                await self._api.delete(f"{paths.jobs(job.namespace)}/{job.name}")
        return bool(others)

    async def give_up(self, obj: Object) -> None:
        """Release a Campaign whose namespace is being deleted: no Job can be created there."""
        if "deletionTimestamp" in obj["metadata"] and self.holds(obj):
            finalizers = obj["metadata"]["finalizers"]
            await self._set(obj, [name for name in finalizers if name != FINALIZER])
            bucket = (obj.get("status") or {}).get("bucket")
            LOGGER.warning("the bucket %s stays: its namespace is being deleted", bucket)

    async def _cause(self, job: JobState) -> str:
        """Return why a Job could not remove the bucket, and how to try again."""
        found = trouble_of([pod async for pod in self._diagnosis.pods_of(job)])
        why = found.message if found is not None else job.message
        return f"{clause(why)}. To try again, run `kubectl delete job {job.name}`."

    async def _report_waiting(self, obj: Object, why: str) -> None:
        """Report by an Event why no Job can remove the bucket."""
        text = sentence(f"The bucket and the Campaign cannot be deleted: {why}")
        message = EventContent("Warning", "DeletionIncomplete", text, why)
        await announce(self._api, Identity.of(obj), message)

    async def _set(self, obj: Object, finalizers: list[str]) -> None:
        meta = obj["metadata"]
        path = f"{paths.campaigns(meta['namespace'])}/{meta['name']}"
        # With its version: the list is written as a whole, and others may have changed theirs.
        changed = {"finalizers": finalizers, "resourceVersion": meta["resourceVersion"]}
        await self._api.patch(path, {"metadata": changed})
