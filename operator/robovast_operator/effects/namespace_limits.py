"""Reads the ResourceQuotas and LimitRanges of namespaces."""

from __future__ import annotations

import time

from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.pods.admission import NamespaceLimits

KEEP_SECONDS = 60.0
"""How long the limits of a namespace are used before they are read again [s]."""


class NamespaceLimitsReader:
    """Reads the limits of a namespace at most once a minute."""

    def __init__(self, api: Api) -> None:
        self._api = api
        self._cache: dict[str, tuple[float, NamespaceLimits]] = {}

    async def read(self, namespace: str) -> NamespaceLimits:
        """Read the limits of a namespace; limits without read permission count as absent.

        Raises:
            ApiError: the API server does not answer.
        """
        read_at, limits = self._cache.get(namespace, (0.0, NamespaceLimits()))
        if not read_at or time.monotonic() - read_at > KEEP_SECONDS:
            quotas = await self._list(paths.resource_quotas(namespace))
            limits = NamespaceLimits(quotas, await self._list(paths.limit_ranges(namespace)))
            self._cache[namespace] = (time.monotonic(), limits)
        return limits

    async def _list(self, path: str) -> list[Object]:
        try:
            return [item async for item in self._api.list(path)]
        except ApiError as error:
            if error.code in {401, 403}:
                return []
            raise
