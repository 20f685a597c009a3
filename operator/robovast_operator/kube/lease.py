"""Leader election: one replica of one installation works in each namespace.

Each installation has one Lease, in its own namespace, whose annotation names the namespaces that it
watches. A replica claims the Lease of its installation, then lists the Leases of all others. It
leads if no other installation with a common namespace has a claim. Of two that claim at the same
time, at least one sees the other; the one whose namespace sorts last withdraws.

Users may write Leases in their own namespaces. So the Lease of another installation counts only if
the API server confirms that the operator's ServiceAccount in its namespace may write the status of
Campaigns where both work: users cannot grant that right.

Not `kubernetes.aio.leaderelection`: its leader cannot check before a write whether it still leads.
"""

from __future__ import annotations

import asyncio
import logging
import re
import time
from collections.abc import Mapping
from math import inf

from robovast.kubeapi.resources import GROUP
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import now
from robovast_operator.kube.untrusted_fields import LARGEST, mapping, number, text
from robovast_operator.settings import OperatorSettings

LOGGER = logging.getLogger(__name__)

NAME = "robovast-operator"

SCOPE = "robovast.io/namespaces"
"""Annotation of a Lease: the watched namespaces, separated by commas; all if empty or missing."""

RIVAL_TERMS = 2
"""How many durations a claim of another installation lasts after its last renewal, and after its
release: a replica of that installation takes over first, for example during an upgrade."""

CLAIM_TERMS = 4
"""How many durations a replica claims the Lease without leading. A claim of an installation that
waits for a leader would keep others waiting that have nothing in common with that leader."""

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

_FORBIDDEN = (
    "The operator has no permission that it needs to find other operators, and writes nothing: "
    "{error}. The chart grants it with the ClusterRole robovast-operator-leases-{space} and with "
    "the Role robovast-operator-lease in the namespace {space}. Restore both with `helm "
    "upgrade`, or ask your cluster administrator."
)

_SPACE = re.compile("[a-z0-9-]{1,63}")
"""Name of a namespace: users may write anything into the annotation."""

ACCOUNT = "robovast-operator"
"""Name of the operator's ServiceAccount, which the chart sets."""

CONFIRMED_SECONDS = 60.0
"""How long the answer about an account is believed [s]."""

CONFIRMED = 10_000
"""Most answers that are kept."""

ATTEMPTS = 15
"""How many attempts are made within the duration while renewing fails."""


class Leadership:
    """Holds the Lease as long as possible; `leading` shows whether it does."""

    def __init__(self, api: Api, settings: OperatorSettings) -> None:
        self._api = api
        self._settings = settings
        self._until = -inf
        self.term = 0
        """Counts how often this replica took the Lease; its memory is valid for one term."""
        self._read_first: dict[str, tuple[object, float]] = {}
        """By namespace of a Lease: holder and renewal time, and when they were first read."""
        self.rival = ""
        """Why this installation does not work: another one does; empty if none does."""
        self.failure = ""
        """Why the Lease cannot be claimed; empty if it can, or while this replica leads."""
        self._leader = ""
        self._claimed_at = -inf
        self._confirmed: dict[tuple[str, str], tuple[bool, float]] = {}
        """By namespace of an installation and common namespace: the answer, and when it came."""
        self._acquired = asyncio.Event()

    @property
    def leading(self) -> bool:
        """Return whether this replica may work now."""
        return time.monotonic() < self._until

    async def wait(self) -> None:
        """Wait until this replica leads."""
        while not self.leading:
            self._acquired.clear()
            await self._acquired.wait()

    async def keep(self) -> None:
        """Acquire and renew the Lease, without end."""
        while True:
            asked, attempts = time.monotonic(), ATTEMPTS
            try:
                bound = self._settings.lease_seconds / (RENEWALS if self.leading else 2)
                async with asyncio.timeout(bound):
                    held = await self._renew()
                self.failure = ""
                if held:
                    attempts = RENEWALS
                    self._notice(self._settings.identity)
                    # counted from before the request: others count from what they read
                    self._until = asked + self._settings.lease_seconds * 2 / 3
                    self._acquired.set()
            except (ApiError, OSError) as error:
                LOGGER.warning("the Lease cannot be renewed: %s", error)
                self.failure = "" if self.leading else self._explain(error)
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
        """Return the Leases of all installations by namespace."""
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
        rival = None if self.leading else await self._find_rival(leases)
        if rival is not None and not (
            self._is_mine(own)
            and self._settings.lease_namespace < rival
            and not self._claims_in_vain()
        ):
            self._report_rival(rival)
            await self._withdraw(own)
            return False
        if not await self._claim(own):
            return False
        if not self.leading:
            leases = await self._leases()
            leases.pop(self._settings.lease_namespace, None)
            rival = await self._find_rival(leases)
        self._report_rival(rival)
        return rival is None

    async def _claim(self, lease: Object | None) -> bool:
        """Write this replica into the Lease; return False if another replica was faster."""
        mine = self._is_mine(lease)
        meta: Object = {"name": NAME, "namespace": self._settings.lease_namespace}
        previous = mapping(mapping(lease).get("metadata")) or meta
        scope = {SCOPE: ",".join(self._settings.namespaces)}
        made: Object = {
            "apiVersion": "coordination.k8s.io/v1",
            "kind": "Lease",
            "metadata": {
                **previous,
                "annotations": {**mapping(previous.get("annotations")), **scope},
            },
            "spec": self._claimed(mapping(mapping(lease).get("spec"))),
        }
        if lease is None:
            held = await self._api.create(self._collection, made) is not None
        else:
            held = await self._replace(made)
        if held and not mine:
            self._claimed_at = time.monotonic()
        self.term += held and not mine  # late, but ours all the time: no other has led
        return held

    def _claims_in_vain(self) -> bool:
        """Return whether this replica has claimed the Lease for long."""
        limit = CLAIM_TERMS * self._settings.lease_seconds
        return time.monotonic() - self._claimed_at > limit

    async def _withdraw(self, lease: Object | None) -> None:
        """Release the Lease if this replica is the holder."""
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
        """Return whether a Lease was not renewed for some durations, measured by our own clock.

        One that was released counts as expired, unless it was renewed or released meanwhile.
        """
        space, spec = str(lease["metadata"]["namespace"]), mapping(lease.get("spec"))
        read = (spec.get("holderIdentity"), spec.get("renewTime"))
        previous, since = self._read_first.get(space, (None, -inf))
        if read != previous:
            since = time.monotonic() if read[0] or previous is not None else -inf
            self._read_first[space] = (read, since)
        longest = max(LONGEST, self._settings.lease_seconds)
        duration = min(number(spec.get("leaseDurationSeconds")) or 1, longest)
        released = terms == 1 and not read[0]
        return released or time.monotonic() - since > terms * duration

    async def _find_rival(self, leases: Mapping[str, Object]) -> str | None:
        """Return the namespace of another installation that manages common namespaces."""
        alive = [s for s, lease in leases.items() if not self._expired(lease, RIVAL_TERMS)]
        for space in sorted(alive):
            common = self._common(leases[space])
            if common is not None and await self._is_operator(space, common):
                return space
        return None

    def _common(self, lease: Object) -> str | None:
        """Return a common namespace; empty if any may be common, None without a common one."""
        given = text(mapping(lease["metadata"].get("annotations")).get(SCOPE))
        own, others = (
            set(self._settings.namespaces),
            set(filter(_SPACE.fullmatch, given.split(","))),
        )
        if not others:
            return ""
        return min(own & others if own else others, default=None)

    async def _is_operator(self, space: str, common: str) -> bool:
        """Return whether the ServiceAccount of an installation may manage a namespace, or all."""
        key = (space, common)
        previous = self._confirmed.get(key)
        if previous is None or time.monotonic() - previous[1] > CONFIRMED_SECONDS:
            review: Object = {
                "apiVersion": "authorization.k8s.io/v1",
                "kind": "SubjectAccessReview",
                "spec": {
                    "user": f"system:serviceaccount:{space}:{ACCOUNT}",
                    "resourceAttributes": {
                        "group": GROUP,
                        "resource": "campaigns",
                        "subresource": "status",
                        "verb": "patch",
                        "namespace": common,
                    },
                },
            }
            answer = await self._api.create(paths.ACCESS_REVIEWS, review)
            allowed = mapping(mapping(answer).get("status")).get("allowed") is True
            while len(self._confirmed) >= CONFIRMED:
                del self._confirmed[next(iter(self._confirmed))]
            previous = self._confirmed[key] = (allowed, time.monotonic())
        return previous[0]

    def _explain(self, error: ApiError | OSError) -> str:
        """Explain why the Lease cannot be claimed, and what to do."""
        if isinstance(error, ApiError) and error.code == 403:
            space = self._settings.lease_namespace
            return _FORBIDDEN.format(space=space, error=error)
        return f"The Lease {NAME} cannot be claimed: {str(error) or type(error).__name__}."

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
