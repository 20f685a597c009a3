"""How often the status of one Campaign is written."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS, campaign

from robovast.kubeapi.status import CampaignStatus, Condition
from robovast_operator.effects import status_writer
from robovast_operator.effects.status_writer import MOST_WRITES, WINDOW, Statuses
from robovast_operator.kube.store import Store
from robovast_operator.kube.work_queue import WorkQueue


class Server:
    """Keeps the last status, and counts the writes."""

    def __init__(self) -> None:
        self.writes = 0
        self.status: Any = {}

    async def apply_status(self, path: str, obj: Any) -> Any:
        del path
        self.writes += 1
        self.status = obj["status"]

    async def create(self, path: str, obj: Any) -> Any:
        del path
        return obj


class Silent:
    """Sends no notice."""

    def next(self, obj: Any, status: CampaignStatus) -> tuple[CampaignStatus, None]:
        del obj
        return status, None


def test_a_status_that_flaps_is_written_sixty_times_a_minute_and_the_rest_is_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = SimpleNamespace(now=1000.0)
    monkeypatch.setattr(status_writer, "time", SimpleNamespace(monotonic=lambda: clock.now))
    server, put_off = Server(), list[None]()
    api: Any = server
    notifier: Any = Silent()
    jobs: Any = None
    count = lambda: put_off.append(None)  # noqa: E731
    statuses = Statuses(api, Store(), WorkQueue(), SETTINGS, notifier, jobs, count)

    stalled = CampaignStatus(
        conditions=[
            Condition(
                type="Stalled",
                status="True",
                reason="StorageUnavailable",
                message="No server.",
                last_transition_time="2026-01-01T00:00:00Z",
            )
        ]
    )

    async def flap(seconds: float) -> int:
        before, end = server.writes, clock.now + seconds
        while clock.now < end:
            clock.now += 1 / 70
            await statuses.write(campaign(), stalled)
        return server.writes - before

    assert asyncio.run(flap(WINDOW)) == MOST_WRITES
    assert len(put_off) > 1000
    assert asyncio.run(flap(10 * WINDOW)) <= 11 * MOST_WRITES
