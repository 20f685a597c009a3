"""Leader election: one replica of one installation works in each namespace.

Each installation has one Lease, in its own namespace, whose annotation names the namespaces that it
watches. A replica claims the Lease of its installation, then lists the Leases of all others. It
leads if no other installation with a common namespace has a claim. Of two that claim at the same
time, at least one sees the other; the one whose namespace sorts last withdraws.

Not `kubernetes.aio.leaderelection`: whoever leads there cannot tell before a write whether it does.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping
from math import inf

from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.lenient import LARGEST, mapping, number, text
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import now
from robovast_operator.settings import Settings

LOGGER = logging.getLogger(__name__)

NAME = "robovast-operator"

SCOPE = "robovast.io/namespaces"
"""Annotation of a Lease: the watched namespaces, separated by commas; all if empty or missing."""

RIVAL_TERMS = 2
"""How many durations a claim of another installation lasts after its last renewal, and after its
release: a replica of that installation takes over first, for example during an upgrade."""

RENEWALS = 3
"""How often the Lease is renewed within its duration; each is a write to the API server."""

LONGEST = 300.0
"""Longest time to wait for a holder, whatever duration the Lease states [s]."""

_RIVAL = (
    "Another RoboVAST operator, in the namespace {space}, works in namespaces that this one is to "
    "work in. This operator writes nothing. Uninstall one of the two (`helm uninstall`), or give "
    "both a list `operator.namespaces` without a common namespace. If there is no other operator, "
    f"remove its Lease: `kubectl delete lease {NAME} -n {{space}}`."
)

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
        self._read_first: dict[str, tuple[object, float]] = {}
        """By namespace of a Lease: holder and renewal time, and when they were first read."""
        self.rival = ""
        """Why this installation does not work: another one does; empty if none does."""
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
                bound = self._settings.lease_seconds / (RENEWALS if self.leading else 2)
                async with asyncio.timeout(bound):
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
        if not self.leading:
            return
        self._until = -inf
        await self._withdraw((await self._leases()).get(self._settings.lease_namespace))

    @property
    def _collection(self) -> str:
        return paths.leases(self._settings.lease_namespace)

    async def _leases(self) -> dict[str, Object]:
        """The Leases of all installations by namespace."""
        by_name = {"fieldSelector": f"metadata.name={NAME}"}
        return {
            str(lease["metadata"]["namespace"]): lease
            async for lease in self._api.list(paths.leases(), **by_name)
        }

    async def _renew(self) -> bool:
        """Claim or renew the Lease; return whether this replica may lead."""
        leases = await self._leases()
        own = leases.pop(self._settings.lease_namespace, None)
        if own is not None and not self._is_mine(own) and not self._expired(own):
            self._notice(str(mapping(own.get("spec")).get("holderIdentity")))
            self._report_rival(None)
            return False
        rival = None if self.leading else self._find_rival(leases)
        if rival is not None and not (
            self._is_mine(own) and self._settings.lease_namespace < rival
        ):
            self._report_rival(rival)
            await self._withdraw(own)
            return False
        if not await self._claim(own):
            return False
        if not self.leading:
            leases = await self._leases()
            leases.pop(self._settings.lease_namespace, None)
            rival = self._find_rival(leases)
        self._report_rival(rival)
        return rival is None

    async def _claim(self, lease: Object | None) -> bool:
        """Write this replica into the Lease; return False if another one was faster."""
        mine = self._is_mine(lease)
        meta: Object = {"name": NAME, "namespace": self._settings.lease_namespace}
        known = mapping(mapping(lease).get("metadata")) or meta
        scope = {SCOPE: ",".join(self._settings.namespaces)}
        made: Object = {
            "apiVersion": "coordination.k8s.io/v1",
            "kind": "Lease",
            "metadata": {**known, "annotations": {**mapping(known.get("annotations")), **scope}},
            "spec": self._claimed(mapping(mapping(lease).get("spec"))),
        }
        if lease is None:
            held = await self._api.create(self._collection, made) is not None
        else:
            held = await self._replace(made)
        self.term += held and not mine  # late, but ours all the time: no other has led
        return held

    async def _withdraw(self, lease: Object | None) -> None:
        """Release the Lease if this replica holds it."""
        if lease is not None and self._is_mine(lease):
            spec = {**mapping(lease.get("spec")), "holderIdentity": None}
            await self._replace({**lease, "spec": spec})

    async def _replace(self, lease: Object) -> bool:
        """Write the Lease; return False if another replica was faster."""
        try:
            await self._api.update(f"{self._collection}/{NAME}", lease)
        except ApiError as error:
            if error.code == 409:
                return False
            raise
        return True

    def _is_mine(self, lease: Object | None) -> bool:
        return mapping(mapping(lease).get("spec")).get("holderIdentity") == self._settings.identity

    def _expired(self, lease: Object, terms: int = 1) -> bool:
        """Whether a Lease was not renewed for some durations, measured by our own clock.

        One that was released counts as expired, unless it was renewed or released meanwhile.
        """
        space, spec = str(lease["metadata"]["namespace"]), mapping(lease.get("spec"))
        read = (spec.get("holderIdentity"), spec.get("renewTime"))
        known, since = self._read_first.get(space, (None, -inf))
        if read != known:
            since = time.monotonic() if read[0] or known is not None else -inf
            self._read_first[space] = (read, since)
        longest = max(LONGEST, self._settings.lease_seconds)
        duration = min(number(spec.get("leaseDurationSeconds")) or 1, longest)
        released = terms == 1 and not read[0]
        return released or time.monotonic() - since > terms * duration

    def _find_rival(self, leases: Mapping[str, Object]) -> str | None:
        """The namespace of another installation that works where this one is to work."""
        alive = [s for s, lease in leases.items() if not self._expired(lease, RIVAL_TERMS)]
        return next((s for s in sorted(alive) if self._overlaps(leases[s])), None)

    def _overlaps(self, lease: Object) -> bool:
        given = text(mapping(lease["metadata"].get("annotations")).get(SCOPE))
        own, others = set(self._settings.namespaces), {name for name in given.split(",") if name}
        return not own or not others or bool(own & others)

    def _report_rival(self, space: str | None) -> None:
        found = "" if space is None else _RIVAL.format(space=space)
        if found and found != self.rival:
            LOGGER.error("%s", found)
        self.rival = found

    def _notice(self, leader: str) -> None:
        if leader != self._leader:
            LOGGER.info("%s leads", leader)
        self._leader = leader

    def _claimed(self, spec: Object) -> Object:
        moment = now().strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        mine = spec.get("holderIdentity") == self._settings.identity
        return {
            "holderIdentity": self._settings.identity,
            "leaseDurationSeconds": max(1, round(self._settings.lease_seconds)),
            "acquireTime": spec.get("acquireTime") if mine else moment,
            "renewTime": moment,
            "leaseTransitions": min(LARGEST, number(spec.get("leaseTransitions")) + (not mine)),
        }
