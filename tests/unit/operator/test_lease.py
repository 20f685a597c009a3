"""A Lease that is lost and regained."""

from __future__ import annotations

import asyncio
import copy
from dataclasses import replace
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS
from support.patience import PATIENCE

from robovast_operator.kube import lease as lease_module
from robovast_operator.kube.api import ApiError
from robovast_operator.kube.lease import Leadership


class Server:
    """Keeps a Lease; away, it answers nothing."""

    def __init__(self) -> None:
        self.lease: Any = None
        self.away = False

    async def get(self, path: str) -> Any:
        if self.away:
            raise ApiError(0, "Unreachable", path)
        if self.lease is None:
            raise ApiError(404, "NotFound", path)
        return copy.deepcopy(self.lease)

    async def create(self, path: str, obj: Any) -> Any:
        return await self.update(path, obj)

    async def update(self, path: str, obj: Any) -> Any:
        del path
        self.lease = obj
        return obj


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
    server.lease = {"spec": spec}
    leadership = Leadership(server, replace(SETTINGS, lease_seconds=0.3))

    async def lead() -> None:
        keeping = asyncio.create_task(leadership.keep())
        await leadership.wait()
        keeping.cancel()
        await leadership.release()

    asyncio.run(asyncio.wait_for(lead(), PATIENCE))
    assert server.lease["spec"]["holderIdentity"] is None
    assert server.lease["spec"]["leaseTransitions"] < 2**31
