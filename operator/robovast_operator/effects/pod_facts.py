"""Saves what only Kubernetes knows about the pods of runs, before their Jobs are deleted."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Mapping
from typing import Any

from robovast.base.containers import named_digest
from robovast.kubeapi.pod_contract.pod_facts import Sightings
from robovast.kubeapi.resources import ROLE_LABEL
from robovast_operator.effects.diagnose import Diagnosis
from robovast_operator.kube import paths
from robovast_operator.kube.announce import is_refusal
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.planning.campaign import Accepted
from robovast_operator.pods.jobs import SIGHTINGS_ROLE, sightings_config_map
from robovast_operator.pods.pod_status import sighted

LOGGER = logging.getLogger(__name__)


class Witness:
    """Reads the pods of each ended Job of runs once."""

    def __init__(self, api: Api, diagnosis: Diagnosis) -> None:
        self._api = api
        self._diagnosis = diagnosis

    async def update(
        self, accepted: Accepted, witnessed: set[str], jobs: Mapping[str, JobState]
    ) -> None:
        """Save the sightings of Jobs that have ended since the last reconcile."""
        for job in jobs.values():
            ended = job.role == "shard" and job.finished
            if ended and job.uid not in witnessed:
                await self._keep(accepted, job)
                witnessed.add(job.uid)

    async def _keep(self, accepted: Accepted, job: JobState) -> None:
        """Save the sightings in a ConfigMap, which makes run records complete."""
        seen = Sightings.together([sighted(pod) async for pod in self._pods(accepted, job)])
        if not seen:
            return
        made = sightings_config_map(accepted.identity, job.uid, seen)
        try:
            await self._api.create(paths.config_maps(job.namespace), made)
        except ApiError as error:
            if not is_refusal(error):
                raise
            LOGGER.warning("%s/%s: cannot keep the record of its pods: %s", *job.key, error)

    def _pods(self, accepted: Accepted, job: JobState) -> AsyncIterator[Object]:
        """Generate all pods of a Job; only failed pods if the image is named by its digest."""
        named: dict[str, Any] = {"fieldSelector": "status.phase=Failed"}
        return self._diagnosis.pods_of(job, **(named if named_digest(accepted.image) else {}))

    async def kept(self, accepted: Accepted) -> list[str]:
        """Return names of the ConfigMaps with sightings."""
        identity = accepted.identity
        selector = identity.selector(**{ROLE_LABEL: SIGHTINGS_ROLE})
        found = self._api.list(paths.config_maps(identity.namespace), labelSelector=selector)
        names = [obj["metadata"]["name"] async for obj in found]
        return sorted(name for name in names if name.startswith(identity.child("pods-")))
