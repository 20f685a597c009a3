"""A Lease that is lost and regained."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from operator_world import SETTINGS

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
        return {"spec": dict(self.lease["spec"])}

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

    assert asyncio.run(asyncio.wait_for(terms(), 20)) == [1, 1, 2]
