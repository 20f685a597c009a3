"""Searches under the operator, on a real API server; the nodes are fake."""

from __future__ import annotations

import json
from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    FINISHED,
    SAID,
    NewOperator,
    campaign,
    condition,
    finished,
    status,
)
from support.patience import eventually

TOTAL = FINISHED["seek"]


def search(name: str, namespace: str) -> dict[str, Any]:
    made = campaign(name, namespace, 1, 2)
    vast = made["spec"]["vast"]
    del vast["configuration"]
    vast["search"] = {
        "strategy": "random",
        "search_space": {"x": {"type": "int", "low": 0, "high": 99}},
        "objectives": [{"name": "failure_rate"}],
        "per_batch": 4,
        "budget": [{"batches": 2}],
    }
    return made


def test_a_search_grows_its_plan_whenever_the_operator_dies(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    fake_cluster.apply(search("seek", namespace))
    operator = new_operator(ROBOVAST_LEASE_SECONDS="1")
    deaths = 0
    while deaths < 4 and not finished(fake_cluster, namespace, "seek"):
        before = status(fake_cluster, namespace, "seek")
        operator.start()
        eventually(
            lambda before=before: status(fake_cluster, namespace, "seek") != before,  # type: ignore[misc]
            60,
            operator.told,
        )
        operator.kill()
        deaths += 1
    operator.start()
    eventually(lambda: finished(fake_cluster, namespace, "seek"), 120, operator.told)
    state = status(fake_cluster, namespace, "seek")
    told = {key: value for key, value in SAID[2].items() if key not in {"blocks", "digest"}}
    assert state["search"] == told
    assert state["progress"] == f"{TOTAL}/{TOTAL}"
    assert condition(state, "Passed")["status"] == "True"
    assert len(json.dumps(state)) < 6000
    inside = f"--namespace={namespace}"
    maps = [item["metadata"]["name"] for item in fake_cluster.get("configmaps", inside)["items"]]
    plans = sorted(name.partition("-plan-")[2] for name in maps if "-plan-" in name)
    assert plans == ["0", "1", "compose"]
    assert fake_cluster.get("configurations", inside)["items"] == []
    shown = fake_cluster.kubectl(inside, "get", "campaign", "seek", "--output=wide")
    assert "BATCH" in shown.upper()
    assert "failure_rate 1" in shown


def test_a_pod_that_asks_for_runs_twice_ends_the_search(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    fake_cluster.apply(search("odd", namespace))
    operator = new_operator()
    operator.start()
    eventually(
        lambda: status(fake_cluster, namespace, "odd").get("state") == "Failed", 120, operator.told
    )
    state = status(fake_cluster, namespace, "odd")
    assert condition(state, "Succeeded")["reason"] == "InvalidPlan"
    assert "those that come next" in condition(state, "Succeeded")["message"]
    assert state["runs"]["total"] == 8
