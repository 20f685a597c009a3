"""A Lease that is lost and regained."""

from __future__ import annotations

import asyncio
import copy
import itertools
import random
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS
from support.patience import PATIENCE

from robovast_operator.kube import lease as lease_module
from robovast_operator.kube.api import ApiError
from robovast_operator.kube.lease import Leadership
from robovast_operator.kube.paths import ACCESS_REVIEWS


class Server:
    """Keeps Leases by namespace; away, it answers nothing."""

    def __init__(self, delay: Callable[[], float] = lambda: 0.0) -> None:
        self.leases: dict[str, Any] = {}
        self.operators: set[tuple[str, str]] | None = None
        """By namespace: whose account may work where, empty for everywhere; None: all may."""
        self.forbidden: set[str] = set()
        """Verbs, and `review`, that are refused."""
        self.away = False
        self._delay = delay

    @property
    def lease(self) -> Any:
        return self.leases[OWN]

    def _check(self, verb: str) -> None:
        if verb in self.forbidden:
            raise ApiError(403, "Forbidden", f"cannot {verb} it")

    def _review(self, spec: Any) -> Any:
        self._check("review")
        space = spec["user"].split(":")[2]
        asked = spec["resourceAttributes"]
        assert (asked["verb"], asked["resource"], asked["subresource"]) == (
            *("patch", "campaigns"),
            "status",
        )
        found = self.operators
        allowed = found is None or bool({(space, ""), (space, asked["namespace"])} & found)
        return {"status": {"allowed": allowed}}

    async def list(self, path: str, **_: str) -> AsyncIterator[Any]:
        await asyncio.sleep(self._delay())
        self._check("list")
        if self.away:
            raise ApiError(0, "Unreachable", path)
        found = [copy.deepcopy(lease) for lease in self.leases.values()]
        await asyncio.sleep(self._delay())
        for lease in found:
            yield lease

    async def create(self, path: str, obj: Any) -> Any:
        await asyncio.sleep(self._delay())
        if path == ACCESS_REVIEWS:
            return self._review(obj["spec"])
        self._check("create")
        if space_of(path) in self.leases:
            return None
        return self._put(path, obj)

    async def update(self, path: str, obj: Any) -> Any:
        await asyncio.sleep(self._delay())
        self._check("update")
        known = self.leases[space_of(path)]["metadata"].get("resourceVersion")
        if known != obj["metadata"].get("resourceVersion"):
            raise ApiError(409, "Conflict", path)
        return self._put(path, obj)

    def _put(self, path: str, obj: Any) -> Any:
        version = str(int(obj["metadata"].get("resourceVersion", "0")) + 1)
        obj["metadata"] = {**obj["metadata"], "resourceVersion": version}
        self.leases[space_of(path)] = copy.deepcopy(obj)
        return obj


OWN = SETTINGS.lease_namespace


def space_of(path: str) -> str:
    return path.partition("/namespaces/")[2].partition("/")[0]


def test_a_term_ends_when_another_replica_leads_and_not_when_a_renewal_is_late() -> None:
    server: Any = Server()
    leadership = Leadership(server, replace(SETTINGS, lease_seconds=0.3))

    async def terms() -> list[int]:
        keeping = asyncio.create_task(leadership.keep())
        found = []
        await leadership.wait()
        found.append(leadership.term)
        server.away = True
        while leadership.leading:
            await asyncio.sleep(0.05)
        server.away = False
        await leadership.wait()
        found.append(leadership.term)
        server.lease["spec"]["holderIdentity"] = "another"
        while leadership.leading:
            await asyncio.sleep(0.05)
        await leadership.wait()
        found.append(leadership.term)
        keeping.cancel()
        return found

    assert asyncio.run(asyncio.wait_for(terms(), PATIENCE)) == [1, 1, 2]


@pytest.mark.parametrize(
    "spec",
    [
        None,
        {},
        {"holderIdentity": "gone", "leaseDurationSeconds": 2**31 - 1},
        {"holderIdentity": "", "leaseTransitions": 2**31 - 1},
        {"holderIdentity": "gone", "renewTime": "2999-01-01T00:00:00.000000Z"},
    ],
)
def test_whatever_stands_in_the_lease_somebody_leads(
    spec: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Anybody who may write it may have: it is waited for no longer than five minutes."""
    monkeypatch.setattr(lease_module, "LONGEST", 0.5)
    server: Any = Server()
    server.leases[OWN] = {"metadata": {"namespace": OWN, "name": "robovast-operator"}, "spec": spec}
    leadership = Leadership(server, replace(SETTINGS, lease_seconds=0.3))

    async def lead() -> None:
        keeping = asyncio.create_task(leadership.keep())
        await leadership.wait()
        keeping.cancel()
        await leadership.release()

    asyncio.run(asyncio.wait_for(lead(), PATIENCE))
    assert server.lease["spec"]["holderIdentity"] is None
    assert server.lease["spec"]["leaseTransitions"] < 2**31


INSTALLATIONS = {
    "all": (),
    "all-too": (),
    "a": ("x", "y"),
    "b": ("y", "z"),
    "c": ("z",),
    "d": ("w",),
}
"""Watched namespaces by namespace of the installation; none means all."""


def overlaps(one: str, other: str) -> bool:
    mine, others = set(INSTALLATIONS[one]), set(INSTALLATIONS[other])
    return not mine or not others or bool(mine & others)


@pytest.mark.parametrize("seed", range(4))
def test_of_installations_with_a_common_namespace_one_leads_until_it_ends(seed: int) -> None:
    """They start and end in any order, with or without releasing the Lease."""
    chance = random.Random(seed)  # noqa: S311
    server: Any = Server(lambda: chance.uniform(0, 0.02))
    spaces = chance.sample(list(INSTALLATIONS), 4)
    found = {
        space: Leadership(
            server,
            replace(
                SETTINGS,
                lease_namespace=space,
                identity=f"pod-{space}",
                namespaces=INSTALLATIONS[space],
                lease_seconds=0.6,
            ),
        )
        for space in spaces
    }

    def leaders() -> set[str]:
        return {space for space, one in found.items() if one.leading}

    def settled(running: set[str]) -> bool:
        """Whether each installation leads, or is blocked by one that leads."""
        now = leaders()
        return bool(now) and all(
            s in now or (found[s].rival and any(overlaps(s, o) for o in now)) for s in running
        )

    async def check(seconds: float) -> None:
        end = asyncio.get_running_loop().time() + seconds
        while asyncio.get_running_loop().time() < end:
            now = leaders()
            both = [(o, p) for o in now for p in now if o < p and overlaps(o, p)]
            assert not both, both
            await asyncio.sleep(0.005)

    async def play() -> None:
        tasks = {}
        for space in spaces:
            tasks[space] = asyncio.create_task(found[space].keep())
            await check(chance.choice([0, 0.05, 0.5]))
        while tasks:
            while not settled(set(tasks)):  # bounded by the wait below
                await check(0.05)
            now = leaders()
            gone = chance.choice(sorted(now & set(tasks)) or sorted(tasks))
            tasks.pop(gone).cancel()
            if chance.random() < 0.5:
                await found[gone].release()

    asyncio.run(asyncio.wait_for(play(), PATIENCE))


def test_a_replica_of_the_leading_installation_comes_before_another_installation() -> None:
    server: Any = Server()
    own = replace(SETTINGS, lease_seconds=0.5)
    first, second = (Leadership(server, replace(own, identity=name)) for name in ("one", "two"))
    other = Leadership(server, replace(own, lease_namespace="other", identity="three"))

    async def hand_over() -> None:
        keeping = asyncio.create_task(first.keep())
        await first.wait()
        others = [asyncio.create_task(one.keep()) for one in (second, other)]
        await asyncio.sleep(0.5)
        assert "default" in other.rival
        keeping.cancel()
        await first.release()
        await asyncio.sleep(0.8)
        assert (second.leading, other.leading) == (True, False)
        for task in others:
            task.cancel()

    asyncio.run(asyncio.wait_for(hand_over(), PATIENCE))


SCOPES = ["", "x", "y,x", "elsewhere", None, 5, "\n/../,%" + "x" * 70]


@pytest.mark.parametrize("own", [(), ("x", "y")])
@pytest.mark.parametrize("scope", SCOPES)
@pytest.mark.parametrize("operators", [set(), {("team", "team")}, {("x", "")}])
def test_a_lease_of_a_user_blocks_no_operator(
    own: tuple[str, ...], scope: object, operators: set[tuple[str, str]]
) -> None:
    """A user renews it without end; its account has no rights where the operator works."""
    server: Any = Server()
    server.operators = operators
    settings = replace(SETTINGS, namespaces=own, lease_seconds=3)
    leadership = Leadership(server, settings)

    async def lead() -> None:
        keeping = asyncio.create_task(leadership.keep())
        renewals = itertools.count()
        while not leadership.leading:
            assert (leadership.rival, leadership.failure) == ("", "")
            server.leases["team"] = foreign_lease(scope, next(renewals))
            await asyncio.sleep(0.02)
        keeping.cancel()

    asyncio.run(asyncio.wait_for(lead(), PATIENCE))


def foreign_lease(scope: object, renewal: int = 0) -> Any:
    """A Lease in the namespace `team` whose annotation is a scope."""
    meta = {"namespace": "team", "name": "robovast-operator"}
    spec = {"holderIdentity": "foreign", "renewTime": str(renewal), "leaseDurationSeconds": 60}
    return {"metadata": {**meta, "annotations": {lease_module.SCOPE: scope}}, "spec": spec}


@pytest.mark.parametrize(
    ("own", "scope", "operators", "blocked"),
    [
        ((), "", {("team", "")}, True),
        ((), "x", {("team", "x")}, True),
        (("x",), "x,y", {("team", "x")}, True),
        (("x",), "", {("team", "")}, True),
        (("x",), "", {("team", "x")}, False),
        (("x",), "y", {("team", "")}, False),
    ],
)
def test_the_lease_of_an_operator_with_its_rights_counts(
    *, own: tuple[str, ...], scope: str, operators: set[tuple[str, str]], blocked: bool
) -> None:
    server: Any = Server()
    server.operators = operators
    server.leases["team"] = foreign_lease(scope)
    leadership = Leadership(server, replace(SETTINGS, namespaces=own, lease_seconds=3))

    async def ask() -> None:
        keeping = asyncio.create_task(leadership.keep())
        while not (leadership.leading or leadership.rival):
            await asyncio.sleep(0.01)
        keeping.cancel()

    asyncio.run(asyncio.wait_for(ask(), PATIENCE))
    assert (bool(leadership.rival), leadership.leading) == (blocked, not blocked)


@pytest.mark.parametrize("verb", ["list", "create", "update", "review"])
def test_a_missing_permission_is_a_reason_not_to_be_ready(verb: str) -> None:
    server: Any = Server()
    server.forbidden = {verb}
    server.leases["team"] = foreign_lease("")
    server.operators = set()
    if verb == "update":
        server.leases[OWN] = {"metadata": {"namespace": OWN, "name": "robovast-operator"}}
    leadership = Leadership(server, replace(SETTINGS, lease_seconds=3))

    async def ask() -> str:
        keeping = asyncio.create_task(leadership.keep())
        while not leadership.failure:
            assert not leadership.leading
            await asyncio.sleep(0.01)
        told = leadership.failure
        server.forbidden = set()
        await leadership.wait()
        assert leadership.failure == ""
        keeping.cancel()
        return told

    told = asyncio.run(asyncio.wait_for(ask(), PATIENCE))
    assert f"cannot {verb} it" in told
    assert f"robovast-operator-leases-{OWN}" in told
