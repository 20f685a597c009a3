"""Makes a campaign's Jobs, and notices those whose names others have taken."""

from __future__ import annotations

from collections.abc import Mapping

from robovast_operator.effects.jobs import Jobs
from robovast_operator.kube import paths
from robovast_operator.kube.announce import announce
from robovast_operator.kube.api import Api
from robovast_operator.kube.events import EventContent
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.store import QUEUE_LABEL, JobState, Store
from robovast_operator.planning.campaign import Accepted
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.self_contained_jobs import carrying, config_maps_of


class JobMaker:
    """Creates Jobs, and stores them at once, before a watch reports them."""

    def __init__(self, api: Api, store: Store, jobs: Jobs) -> None:
        self._api = api
        self._store = store
        self._jobs = jobs

    async def create(self, identity: Identity, job: Object, taken: set[str]) -> None:
        """Create a Job, or record its name as taken by a foreign Job."""
        fitting: Object | None = job
        if QUEUE_LABEL in job["metadata"]["labels"]:
            fitting = await self._for_its_cluster(identity.namespace, job)
        made = fitting and await self._jobs.create(fitting)
        if made is not None:
            self._store.put_job(JobState.of(made))
        else:
            await self._look(identity, job["metadata"]["name"], taken)

    async def replace_moved(self, accepted: Accepted, jobs: Mapping[str, JobState]) -> None:
        """Delete the open Jobs whose pods use another S3 server than today's.

        They are created again with today's address; stored runs are not repeated. Kueue would take
        the successor of a Job in another cluster for the Job itself, so such a Job stays.
        """
        moved = [
            job
            for job in jobs.values()
            if job.open and not (job.deleting or job.elsewhere)
            if job.address not in {"", accepted.address}
        ]
        for job in moved:
            text = (
                f"The address of the S3 server has changed from {job.address} to "
                f"{accepted.address}. The operator creates the Job {job.name} again. Stored runs "
                "are kept."
            )
            message = EventContent("Normal", "StorageMoved", text, job.uid)
            await announce(self._api, accepted.identity, message)
            await self._api.delete(f"{paths.jobs(job.namespace)}/{job.name}")

    async def _for_its_cluster(self, namespace: str, job: Object) -> Object | None:
        """Return the Job with its ConfigMaps inside if another cluster runs the Job.

        Only Kueue knows the cluster: it sets `spec.managedBy` when the Job is created. Returns None
        if a Job of this name exists.
        """
        asked = await self._jobs.create(job, dry_run=True)
        if asked is None or not JobState.of(asked).elsewhere:
            return asked and job
        where = paths.config_maps(namespace)
        found = {name: await self._api.get(f"{where}/{name}") for name in config_maps_of(job)}
        return carrying(job, found)

    async def look_again(self, identity: Identity, taken: set[str]) -> Trouble | None:
        """Forget names that are free again; return the problem with names that are taken."""
        for name in sorted(taken):
            taken.discard(name)
            await self._look(identity, name, taken)
        if not taken:
            return None
        names = " ".join(sorted(taken))
        return Trouble(
            "NameConflict",
            f"Other owners use the names of Jobs that this campaign needs: {names}. To delete "
            f"these Jobs, run `kubectl delete job -n {identity.namespace} {names}`.",
        )

    async def _look(self, identity: Identity, name: str, taken: set[str]) -> None:
        """Store an existing Job of the campaign, or record its name as taken by a foreign Job."""
        where = paths.jobs(identity.namespace)
        async for found in self._api.list(where, fieldSelector=f"metadata.name={name}"):
            job = JobState.of(found)
            if (job.key, job.campaign_uid) == (identity.key, identity.uid):
                self._store.put_job(job)
            else:
                taken.add(job.name)
