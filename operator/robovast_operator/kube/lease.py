"""Leader election: of several replicas, the one that holds the Lease works.

Not `kubernetes.aio.leaderelection`: whoever leads there cannot tell before a write whether it does.
"""

from __future__ import annotations

import asyncio
import logging
import time
from math import inf

from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.lenient import LARGEST, mapping, number
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import now
from robovast_operator.settings import Settings

LOGGER = logging.getLogger(__name__)

NAME = "robovast-operator"

RENEWALS = 3
"""How often the Lease is renewed within its duration; each is a write to the API server."""

LONGEST = 300.0
"""Longest time to wait for a holder, whatever duration the Lease states [s]."""

ATTEMPTS = 15
"""How many attempts are made within the duration while renewing fails."""


class Leadership:
    """Holds the Lease as long as it can; `leading` tells whether it does."""

    def __init__(self, api: Api, settings: Settings) -> None:
        self._api = api
        self._settings = settings
        self._until = -inf
        self.term = 0
        """Counts how often this replica took the Lease; its memory is valid for one term."""
        self._read_first: tuple[object, float] = (None, 0.0)
        """Holder and renewal time in the Lease, and when they were first read (by our clock)."""
        self._leader = ""
        self._acquired = asyncio.Event()

    @property
    def leading(self) -> bool:
        """Whether this replica may work now."""
        return time.monotonic() < self._until

    async def wait(self) -> None:
        """Wait until this replica leads."""
        while not self.leading:
            self._acquired.clear()
            await self._acquired.wait()

    async def keep(self) -> None:
        """Acquire the Lease and renew it, without end."""
        while True:
            asked, attempts = time.monotonic(), ATTEMPTS
            try:
                async with asyncio.timeout(self._settings.lease_seconds / RENEWALS):
                    held = await self._renew()
                if held:
                    attempts = RENEWALS
                    self._notice(self._settings.identity)
                    # counted from before the request: others count from what they read
                    self._until = asked + self._settings.lease_seconds * 2 / 3
                    self._acquired.set()
            except (ApiError, OSError) as error:
                LOGGER.warning("the Lease cannot be renewed: %s", error)
            await asyncio.sleep(self._settings.lease_seconds / attempts)

    async def release(self) -> None:
        """Let another replica lead at once."""
        if self.leading:
            self._until = -inf
            lease = await self._read()
            spec = mapping(mapping(lease).get("spec"))
            if lease is not None and spec.get("holderIdentity") == self._settings.identity:
                changed = {**lease, "spec": {**spec, "holderIdentity": None}}
                await self._api.update(f"{self._collection}/{NAME}", changed)

    @property
    def _collection(self) -> str:
        return paths.leases(self._settings.lease_namespace)

    async def _read(self) -> Object | None:
        try:
            return await self._api.get(f"{self._collection}/{NAME}")
        except ApiError as error:
            if error.code == 404:
                return None
            raise

    async def _renew(self) -> bool:
        lease = await self._read()
        if lease is None:
            made: Object = {
                "apiVersion": "coordination.k8s.io/v1",
                "kind": "Lease",
                "metadata": {"name": NAME, "namespace": self._settings.lease_namespace},
                "spec": self._claim({}),
            }
            held = await self._api.create(self._collection, made) is not None
            self.term += held
            return held
        spec = mapping(lease.get("spec"))
        mine = spec.get("holderIdentity") == self._settings.identity
        if not mine and not self._expired(spec):
            return False
        lease["spec"] = self._claim(spec)
        try:
            await self._api.update(f"{self._collection}/{NAME}", lease)
        except ApiError as error:
            if error.code == 409:
                return False  # another replica was faster
            raise
        self.term += not mine  # late, but ours all the time: nobody else has done anything
        return True

    def _expired(self, spec: Object) -> bool:
        """Whether the Lease was not renewed for its duration, measured by our own clock."""
        told = (spec.get("holderIdentity"), spec.get("renewTime"))
        if told != self._read_first[0]:
            self._read_first = (told, time.monotonic())
            self._notice(str(told[0] or "nobody"))
        longest = max(LONGEST, self._settings.lease_seconds)
        duration = min(number(spec.get("leaseDurationSeconds")) or 1, longest)
        return not told[0] or time.monotonic() - self._read_first[1] > duration

    def _notice(self, leader: str) -> None:
        if leader != self._leader:
            LOGGER.info("%s leads", leader)
        self._leader = leader

    def _claim(self, spec: Object) -> Object:
        moment = now().strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        mine = spec.get("holderIdentity") == self._settings.identity
        return {
            "holderIdentity": self._settings.identity,
            "leaseDurationSeconds": max(1, round(self._settings.lease_seconds)),
            "acquireTime": spec.get("acquireTime") if mine else moment,
            "renewTime": moment,
            "leaseTransitions": min(LARGEST, number(spec.get("leaseTransitions")) + (not mine)),
        }
