"""Creates Jobs where quotas limit them: adds required limits, and removes our completed Jobs."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.kubeapi.status import CampaignStatus, read_status
from robovast_operator.effects.namespace_limits import NamespaceLimitsReader
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import NOTIFY_ROLE, JobState, Store
from robovast_operator.pods.admission import counts_jobs, with_required_limits
from robovast_operator.pods.own import OWN, naming_containers
from robovast_operator.status.conditions import is_settled


class Jobs:
    """Creates every Job of the operator."""

    def __init__(self, api: Api, store: Store, limits: NamespaceLimitsReader) -> None:
        self._api = api
        self._store = store
        self._limits = limits

    async def create(self, job: Object, *, dry_run: bool = False) -> Object | None:
        """Create a Job; return None if its name is taken.

        If a quota on the number of Jobs refuses it, remove completed Jobs of ours first: the
        caller tries again.

        Raises:
            ApiError: the API server refuses the Job, or does not answer.
        """
        namespace = job["metadata"]["namespace"]
        limits = await self._limits.read(namespace)
        fitting = naming_containers(with_required_limits(job, limits, OWN))
        try:
            return await self._api.create(paths.jobs(namespace), fitting, dry_run=dry_run)
        except ApiError as error:
            if counts_jobs(str(error)):
                for completed in list(self._removable(namespace)):
                    await self._api.delete(f"{paths.jobs(namespace)}/{completed.name}")
            raise

    def _removable(self, namespace: str) -> Iterator[JobState]:
        """Generate the completed Jobs of a namespace whose results are in the status."""
        for key, obj in self._store.campaigns.items():
            if key[0] != namespace:
                continue
            uid = obj["metadata"]["uid"]
            settled = is_settled(obj, {}, self._store.configurations_of(key))
            shards = read_status(CampaignStatus, obj.get("status")).shards
            kept = {shard.job for shard in shards if shard.state in {"Complete", "Failed"}}
            for job in self._store.jobs_of(key, uid).values():
                if job.finished and (settled or job.name in kept):
                    yield job
            for job in self._store.deliveries_of(key, uid):
                if job.finished and (settled or job.role == NOTIFY_ROLE):
                    yield job
