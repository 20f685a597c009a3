"""Campaigns in every state outlive the upgrade from the chart before, the way back, and another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.definitions import (
    NEWER,
    OLDER,
    Redefined,
    as_version,
    now,
    of_chart_0_1_0,
    read,
    redefined,
)
from support.kube.operator_process import FINISHED, NewOperator, campaign, created
from support.patience import eventually

ENDED = ("few", "sour", "seek", "wrong")
"""Campaigns that have passed, failed, searched, and been refused."""
BLOCKED = ("stopped", "waiting", "leaving")
"""Those that are suspended, find no node, and are being deleted."""


class Release:
    """The chart in one version after the other, and a namespace with campaigns."""

    def __init__(self, cluster: Redefined, namespace: str, new_operator: NewOperator) -> None:
        self.cluster = cluster
        self._namespace = namespace
        self._new_operator = new_operator
        self._operators = [new_operator("none")]

    def install(self, version: str) -> None:
        """As Helm does: definitions first, under the running operator, whose successor follows."""
        self.cluster.define({"0.1.0": of_chart_0_1_0, "0.2.0": now}[version]())
        if self._operators[-1].alive:
            self.end_run()
        name = f"{version}-{len(self._operators)}"
        operator = self._new_operator(name, ROBOVAST_AGENT_IMAGE=f"agent:{version}")
        operator.start()
        self._operators[-1].stop()
        self._operators.append(operator)

    def told(self) -> str:
        """Log of the operator that works."""
        return self._operators[-1].told()

    def kubectl(self, *arguments: str) -> str:
        return self.cluster.kubectl(f"--namespace={self._namespace}", *arguments)

    def apply(self, name: str, version: str = OLDER, **spec: Any) -> None:
        """Apply a campaign of four runs, or of those that are its own, as a tool does from Git."""
        variants, runs = {"few": (3, 2), "sour": (20, 3), "busy": (5, 2)}.get(name, (2, 2))
        made = campaign(name, self._namespace, variants, runs, **spec)
        vast = made["spec"]["vast"]
        if name == "seek":
            del vast["configuration"]
            vast["search"] = {
                "strategy": "random",
                "search_space": {"x": {"type": "int", "low": 0, "high": 99}},
                "objectives": [{"name": "failure_rate"}],
                "per_batch": 4,
                "budget": [{"batches": 2}],
            }
        if name == "wrong":
            vast["configuration"][0]["variations"] = [{"NoSuchVariation": {}}]
        self.cluster.apply(as_version(made, version))

    def nowhere(self) -> dict[str, Any]:
        """Scheduling that no node meets before `open_node`."""
        return {"nodeSelector": {"open": self._namespace}}

    def open_node(self) -> None:
        self.cluster.kubectl("label", "node", "kwok-0", f"open={self._namespace}")

    def read(self, name: str) -> dict[str, Any]:
        return read(self.cluster, OLDER, self._namespace, name)

    def status(self, name: str) -> dict[str, Any]:
        return dict(self.read(name).get("status") or {})

    def is_true(self, name: str, condition: str, wanted: str = "True") -> bool:
        """Whether a condition of a campaign has this status."""
        return self.conditions(name).get(condition) == wanted

    def conditions(self, name: str) -> dict[str, str]:
        return {c["type"]: c["status"] for c in self.status(name).get("conditions", [])}

    def standing(self, name: str) -> tuple[Any, ...]:
        """What has to stay of a campaign at which nothing happens."""
        obj = self.read(name)
        leaving = "deletionTimestamp" in obj["metadata"]
        return obj["metadata"]["uid"], obj["status"]["state"], leaving, self.conditions(name)

    def end_run(self) -> None:
        """Let one run of `busy` end, and wait until the status says so."""
        before = int(self.status("busy").get("progress", "0").partition("/")[0])
        chosen = "--selector=robovast.io/campaign=busy,robovast.io/role=shard,!go"

        def running() -> list[str]:
            found = self.kubectl("get", "pods", chosen, "--output=name")
            return found.split()

        pod = eventually(running, told=self.told)[0]
        self.kubectl("label", pod, "go=on")
        wanted = f"{before + 1}/10"
        eventually(lambda: self.status("busy").get("progress") == wanted, told=self.told)

    def ends(self, name: str, seconds: float = 120) -> None:
        """Wait until the results of a campaign are complete, each of its runs counted once."""
        eventually(lambda: self.is_true(name, "ResultsAvailable"), seconds, self.told)
        runs = self.status(name)["runs"]
        assert runs["passed"] + runs["failed"] == runs["total"] == FINISHED.get(name, 60)

    def made(self) -> tuple[dict[str, int], int]:
        """How often each Job was created, and how many pods were."""
        jobs = created(self.cluster, self._namespace, "jobs")
        return dict(jobs), created(self.cluster, self._namespace, "pods").total()


@pytest.fixture
def release(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator, tmp_path: Path
) -> Iterator[Release]:
    with redefined(fake_cluster, tmp_path) as cluster:
        yield Release(cluster, namespace, new_operator)


def start(release: Release) -> None:
    """Bring a campaign into each state."""
    for name in ENDED:
        release.apply(name, parallelism=10)
    release.apply("busy", parallelism=10)
    release.apply("stopped", suspend=True)
    release.apply("waiting", scheduling=release.nowhere())
    storage = {"retention": "Delete"}
    release.apply("leaving", scheduling=release.nowhere(), storage=storage)
    for name in ("few", "sour", "seek"):
        release.ends(name)
    assert release.is_true("few", "Passed")
    assert release.is_true("sour", "Passed", "False")
    eventually(lambda: release.is_true("wrong", "Accepted", "False"), told=release.told)
    eventually(lambda: release.status("stopped").get("state") == "Suspended", told=release.told)
    for name in ("waiting", "leaving"):
        eventually(lambda n=name: release.is_true(n, "Stalled"), told=release.told)  # type: ignore[misc]
    release.kubectl("delete", "campaign", "leaving", "--wait=false")
    eventually(lambda: any("purge" in job for job in release.made()[0]), told=release.told)
    for _ in range(2):
        release.end_run()


def test_campaigns_in_every_state_outlive_upgrade_rollback_and_another_upgrade(
    release: Release,
) -> None:
    release.install("0.1.0")
    start(release)
    ended = {name: release.read(name) for name in ENDED}
    blocked = {name: release.standing(name) for name in BLOCKED}
    made = release.made()

    def nothing_has_changed(*names: str) -> None:
        release.end_run()
        assert release.status("busy")["state"] == "Running"
        assert {name: release.read(name) for name in ended} == ended
        for name in names:
            eventually(lambda n=name: release.standing(n) == blocked[n], told=release.told)  # type: ignore[misc]
        assert release.made() == made, "nothing is executed again"
        assert release.cluster.stored_versions() == [[OLDER]] * 2

    release.install("0.2.0")
    nothing_has_changed(*BLOCKED)
    release.apply("stopped", NEWER, suspend=True, parallelism=3)
    release.apply("newer", NEWER, scheduling=release.nowhere())
    eventually(lambda: release.is_true("newer", "Stalled"), told=release.told)
    blocked |= {name: release.standing(name) for name in ("newer", "stopped")}
    made = release.made()

    release.install("0.1.0")
    with pytest.raises(StartFailed, match=f"no matches for kind .* version .*{NEWER}"):
        release.apply("few", NEWER)
    nothing_has_changed(*BLOCKED, "newer")
    release.apply("stopped", OLDER, parallelism=3)
    release.open_node()
    for name in ("stopped", "waiting", "newer"):
        release.ends(name)
    listed = ("get", f"campaigns.{OLDER}.robovast.io", "--output=name")
    eventually(lambda: "leaving" not in release.kubectl(*listed), told=release.told)
    ended |= {name: release.read(name) for name in ("stopped", "waiting", "newer")}
    made = release.made()

    release.install("0.2.0")
    nothing_has_changed()
    release.kubectl("label", "pods", "--selector=robovast.io/campaign=busy", "go=on", "--overwrite")
    release.ends("busy")
    assert {name: release.read(name) for name in ended} == ended
    jobs, _ = release.made()
    assert set(jobs.values()) == {1}
