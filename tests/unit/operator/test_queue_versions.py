"""Kueue is spoken to in the version that it serves."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS, FakeJob

from robovast_operator.effects.queues import Queues
from robovast_operator.kube.api import ApiError
from robovast_operator.kube.store import Store
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.memory import Motion, QueueCache


class Kueue:
    """Serves some versions, and remembers what was asked for."""

    def __init__(self, *versions: str) -> None:
        self._versions = versions
        self.asked: list[str] = []

    async def get(self, path: str, *, tries: int = 1) -> Any:
        del tries
        self.asked.append(path)
        if path.count("/") > 2 or not self._versions:
            raise ApiError(404, "NotFound", path)
        return {"versions": [{"version": version} for version in self._versions]}

    async def list(self, path: str, **selection: str) -> AsyncIterator[Any]:
        del selection
        self.asked.append(path)
        if path.split("/")[3] not in self._versions:
            raise ApiError(404, "", path)
        condition = {"type": "QuotaReserved", "status": "False", "reason": "Pending"}
        yield shaped({"metadata": {"name": "drive"}, "status": {"conditions": [condition]}})


@pytest.mark.parametrize(
    ("served", "spoken"),
    [
        (("v1beta1",), "v1beta1"),
        (("v1beta2", "v1beta1"), "v1beta2"),
        (("v1beta1", "v1beta2"), "v1beta2"),
        (("v1beta3", "v1beta2"), "v1beta2"),
    ],
)
def test_the_newest_version_that_both_know_is_spoken(served: tuple[str, ...], spoken: str) -> None:
    kueue: Any = Kueue(*served)
    waiting = FakeJob("drive-0", "shard", 10, 4, suspended=True).state()
    job = replace(waiting, queue="robovast")
    queues = Queues(kueue, Store(), SETTINGS)
    known, motion = QueueCache(), Motion()

    async def twice() -> None:
        for _ in range(2):
            known.job = ()
            await queues.findings(known, motion, {job.name: job}, suspended=False)

    asyncio.run(twice())
    assert known.waiting is not None
    assert known.waiting.reason == "Queued"
    assert [path for path in kueue.asked if path.endswith("/workloads")] == [
        f"/apis/kueue.x-k8s.io/{spoken}/namespaces/lab/workloads"
    ] * 2
    assert kueue.asked.count("/apis/kueue.x-k8s.io") == 1
