"""Campaigns of a namespace whose pods the installation limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    campaign,
    condition,
    created,
    finished,
    status,
)
from support.patience import eventually

MOST = 3


class Namespace:
    """A namespace whose limit is looked at again and again."""

    def __init__(self, cluster: Cluster, name: str) -> None:
        self._cluster = cluster
        self._name = name

    def pods(self, *selectors: str) -> list[str]:
        """Names of the pods of runs that have not ended."""
        selector = ",".join(("robovast.io/role=shard", *selectors))
        found: Any = self._cluster.get(
            *("pods", f"--namespace={self._name}", f"--selector={selector}")
        )["items"]
        ended = {"Succeeded", "Failed"}
        return [p["metadata"]["name"] for p in found if p["status"]["phase"] not in ended]

    def keeps(self, condition: Callable[[], object]) -> Callable[[], object]:
        """A condition to wait for, while the limit is kept."""

        def look() -> object:
            found = self.pods()
            assert len(found) <= MOST, found
            return condition()

        return look

    def release(self) -> None:
        """Let one run of `busy` end, if one waits for that."""
        held = self.pods("robovast.io/campaign=busy", "!go")
        if held:
            self._cluster.kubectl(*("--namespace", self._name, "label", "pod", held[0], "go=yes"))


def test_a_small_campaign_gets_its_share_before_a_large_one_has_ended(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    limits = f'{{"*": 1, "{namespace}": {MOST}}}'
    operator = new_operator(ROBOVAST_POD_LIMITS=limits, ROBOVAST_STATUS_SECONDS="1")
    operator.start()
    space = Namespace(fake_cluster, namespace)
    fake_cluster.apply(campaign("busy", namespace, 5, 2))
    eventually(space.keeps(lambda: len(space.pods()) == MOST), told=operator.told)
    fake_cluster.apply(campaign("few", namespace, 3, 2))

    def told() -> dict[str, str]:
        return condition(status(fake_cluster, namespace, "few"), "QuotaReserved")

    eventually(space.keeps(lambda: told().get("reason") == "PodLimit"), told=operator.told)
    assert f"{MOST} pods of runs at a time" in told()["message"]
    assert status(fake_cluster, namespace, "few")["state"] == "Queued"

    def few_began() -> bool:
        space.release()
        return status(fake_cluster, namespace, "few")["state"] != "Queued"

    eventually(space.keeps(few_began), told=operator.told)
    eventually(space.keeps(lambda: finished(fake_cluster, namespace, "few")), told=operator.told)
    assert not finished(fake_cluster, namespace, "busy")

    def busy_finished() -> bool:
        space.release()
        return finished(fake_cluster, namespace, "busy")

    eventually(space.keeps(busy_finished), told=operator.told)
    assert created(fake_cluster, namespace, "pods").total() == 10 + 6 + 2, "each run once"
