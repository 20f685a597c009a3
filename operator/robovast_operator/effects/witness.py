"""Keeping what only Kubernetes knows of the pods of runs, before their Jobs go."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Mapping
from typing import Any

from robovast.base.containers import named_digest
from robovast.kubeapi.pod_contract.sightings import Sightings
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
    """Looks once at the pods of each Job of runs that has ended."""

    def __init__(self, api: Api, diagnosis: Diagnosis) -> None:
        self._api = api
        self._diagnosis = diagnosis

    async def update(
        self, accepted: Accepted, witnessed: set[str], jobs: Mapping[str, JobState]
    ) -> None:
        """Keep what is to be seen of Jobs that have ended since the last look."""
        for job in jobs.values():
            ended = job.role == "shard" and job.finished
            if ended and job.uid not in witnessed:
                await self._keep(accepted, job)
                witnessed.add(job.uid)

    async def _keep(self, accepted: Accepted, job: JobState) -> None:
        """Keep it in a ConfigMap; without one its runs' records say less, and nothing wrong."""
        seen = Sightings.together([sighted(pod) async for pod in self._pods(accepted, job)])
        if not seen:
            return
        made = sightings_config_map(accepted.identity, job.uid, seen)
        try:
            await self._api.create(paths.config_maps(job.namespace), made)
        except ApiError as error:
            if not is_refusal(error):
                raise
            LOGGER.warning("%s/%s: what its pods were is not kept: %s", *job.key, error)

    def _pods(self, accepted: Accepted, job: JobState) -> AsyncIterator[Object]:
        """All pods of a Job; of an image that is named by its digest those that failed suffice."""
        named: dict[str, Any] = {"fieldSelector": "status.phase=Failed"}
        return self._diagnosis.pods_of(job, **(named if named_digest(accepted.image) else {}))

    async def kept(self, accepted: Accepted) -> list[str]:
        """Names of the ConfigMaps in which it is kept."""
        identity = accepted.identity
        selector = identity.selector(**{ROLE_LABEL: SIGHTINGS_ROLE})
        found = self._api.list(paths.config_maps(identity.namespace), labelSelector=selector)
        names = [obj["metadata"]["name"] async for obj in found]
        return sorted(name for name in names if name.startswith(identity.child("pods-")))
