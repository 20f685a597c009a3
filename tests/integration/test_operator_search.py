"""Searches under the operator, on a real API server; the nodes are fake."""

from __future__ import annotations

import json
import re
from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    FINISHED,
    SAID,
    NewOperator,
    campaign,
    condition,
    created,
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
    eventually(lambda: finished(fake_cluster, namespace, "seek"), told=operator.told)
    state = status(fake_cluster, namespace, "seek")
    told = {key: value for key, value in SAID[2].items() if key not in {"blocks", "digest"}}
    assert state["search"].pop("plan").endswith("-plan-1")
    assert state["search"] == told
    assert state["progress"] == f"{TOTAL}/{TOTAL}"
    assert condition(state, "Passed")["status"] == "True"
    assert len(json.dumps(state)) < 6000
    inside = f"--namespace={namespace}"
    assert plans(fake_cluster, namespace) == ["0", "1", "compose"]
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
    assert "are not the next runs" in condition(state, "Succeeded")["message"]
    assert state["runs"]["total"] == 8


def applied(cluster: Cluster, namespace: str, name: str, batches: int = 2, **spec: Any) -> None:
    """Apply a search of these batches."""
    made = search(name, namespace)
    made["spec"] |= spec
    made["spec"]["vast"]["search"]["budget"] = [{"batches": batches}]
    cluster.apply(made)


def jobs(cluster: Cluster, namespace: str) -> dict[str, dict[str, Any]]:
    """The Jobs by what their names end with: `propose-1`, `0`."""
    items = cluster.get("jobs", f"--namespace={namespace}")["items"]
    return {re.sub(r"^[a-z]+-[0-9a-f]+-", "", item["metadata"]["name"]): item for item in items}


def test_a_search_that_has_ended_goes_on_when_its_budget_is_patched(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    applied(fake_cluster, namespace, "more")
    operator = new_operator()
    operator.start()
    eventually(lambda: finished(fake_cluster, namespace, "more"), told=operator.told)
    patch = {"spec": {"vast": {"search": {"budget": [{"batches": 3}]}}}}
    inside = f"--namespace={namespace}"
    fake_cluster.kubectl(
        *(inside, "patch", "campaign", "more", "--type=merge", f"--patch={json.dumps(patch)}")
    )
    eventually(
        lambda: status(fake_cluster, namespace, "more")["search"].get("stop") == "exhausted",
        120,
        operator.told,
    )
    eventually(lambda: finished(fake_cluster, namespace, "more"), told=operator.told)
    assert created(fake_cluster, namespace, "jobs").total() == 8, "three shards, four proposals"
    (plan,) = [
        item
        for item in fake_cluster.get("configmaps", inside)["items"]
        if item["metadata"]["name"] == status(fake_cluster, namespace, "more")["search"]["plan"]
    ]
    assert "batches: 3" in plan["data"]["document.vast"]


def test_of_many_plans_the_first_and_the_last_few_are_left(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Each other budget is another plan; none is missed when the operator begins anew."""
    applied(fake_cluster, namespace, "more")
    operator = new_operator(ROBOVAST_LEASE_SECONDS="1")
    operator.start()
    inside = f"--namespace={namespace}"
    eventually(lambda: finished(fake_cluster, namespace, "more"), told=operator.told)
    for number in range(2, 8):
        patch = {"spec": {"vast": {"search": {"budget": [{"batches": number + 1}]}}}}
        fake_cluster.kubectl(
            *(inside, "patch", "campaign", "more", "--type=merge", f"--patch={json.dumps(patch)}")
        )
        eventually(lambda number=number: str(number) in plans(fake_cluster, namespace))  # type: ignore[misc]
        if number == 4:
            operator.kill()
            operator.start()
    left = ["0", "4", "5", "6", "7", "compose"]
    eventually(
        lambda: plans(fake_cluster, namespace) == left,
        60,
        lambda: f"{plans(fake_cluster, namespace)}\n{operator.told()}",
    )


def plans(cluster: Cluster, namespace: str) -> list[str]:
    """What the names of the plans' ConfigMaps end with."""
    items = cluster.get("configmaps", f"--namespace={namespace}")["items"]
    names = [item["metadata"]["name"] for item in items]
    return sorted(name.partition("-plan-")[2] for name in names if "-plan-" in name)


def test_the_runs_of_a_search_wait_for_their_queue_once_they_are_proposed(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    applied(fake_cluster, namespace, "seek", queueName="lab")
    operator = new_operator()
    operator.start()
    eventually(lambda: "0" in jobs(fake_cluster, namespace), told=operator.told)
    found = jobs(fake_cluster, namespace)
    assert found["0"]["metadata"]["labels"]["kueue.x-k8s.io/queue-name"] == "lab"
    assert found["0"]["spec"]["suspend"] is True


def test_a_stopped_search_executes_nothing_goes_on_and_leaves_nothing_when_deleted(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    applied(fake_cluster, namespace, "seek", suspend=True)
    operator = new_operator()
    operator.start()
    eventually(
        lambda: status(fake_cluster, namespace, "seek").get("state") == "Suspended",
        60,
        operator.told,
    )
    assert set(jobs(fake_cluster, namespace)) <= {"propose-0"}
    inside = f"--namespace={namespace}"
    resume = '--patch={"spec":{"suspend":false}}'
    fake_cluster.kubectl(inside, "patch", "campaign", "seek", "--type=merge", resume)
    eventually(
        lambda: status(fake_cluster, namespace, "seek").get("search", {}).get("batch") == 1,
        60,
        operator.told,
    )
    fake_cluster.kubectl(inside, "delete", "campaign", "seek")
    eventually(lambda: not jobs(fake_cluster, namespace), told=operator.told)
    named = ("get", "configmaps", "--selector=robovast.io/campaign=seek", "--output=name")
    eventually(lambda: not fake_cluster.kubectl(inside, *named).strip(), told=operator.told)
