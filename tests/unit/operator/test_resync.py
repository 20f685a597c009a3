"""Comparing what is known with what is there, and what that says of the watches."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS

from robovast_operator.kube import paths
from robovast_operator.kube.objects import Object
from robovast_operator.kube.resync import Resync, WatchedKind
from robovast_operator.kube.store import JobState, Store


def job(name: str) -> Object:
    """A Job of the campaign `drive`."""
    return {
        "metadata": {
            "namespace": "lab",
            "name": name,
            "uid": f"uid-{name}",
            "resourceVersion": "7",
            "labels": {"robovast.io/campaign": "drive"},
        }
    }


class Server:
    """Lists Jobs, and lets something happen before it does."""

    def __init__(self, meanwhile: Callable[[], None]) -> None:
        self.jobs: list[Object] = []
        self._meanwhile = meanwhile

    async def list(self, path: str, **selection: str) -> AsyncIterator[Object]:
        del path, selection
        self._meanwhile()
        for item in self.jobs:
            yield item


@pytest.mark.parametrize("by_ourselves", [True, False])
def test_what_the_operator_makes_during_a_list_is_no_sign_of_a_dead_watch(
    *, by_ourselves: bool
) -> None:
    store = Store()

    def learn(obj: Object) -> None:
        store.put_job(JobState.of(obj))

    def meanwhile() -> None:
        made = job(f"drive-{len(server.jobs)}")
        server.jobs.append(made)
        if by_ourselves:
            learn(made)

    server: Any = Server(meanwhile)
    kind = WatchedKind("Jobs", paths.jobs, store.job_versions, store.has_job, learn, store.drop_job)
    resync = Resync(server, SETTINGS, (kind,))

    async def twice() -> None:
        await resync.compare()
        await resync.compare()

    asyncio.run(twice())
    assert bool(resync.dead_watch) != by_ourselves
    assert len(store.jobs["lab", "drive"]) == 2
