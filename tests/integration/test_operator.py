"""The operator, with the chart's rights, on a real API server; the nodes are fake."""

from __future__ import annotations

import json
import platform
import time
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    ACCOUNT,
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    finished,
    free_port,
    page,
    status,
    write_requests,
)
from support.patience import eventually

from robovast_operator.kube.times import parse_time


@pytest.fixture
def operator(new_operator: NewOperator) -> OperatorProcess:
    """An operator that is up."""
    made = new_operator()
    made.start()
    return made


def test_two_hundred_runs_cost_little_and_their_end_nothing(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """What `tests/bench/cluster_scale.py` measures at ten thousand, in little."""
    begin = fake_cluster.audit_log.stat().st_size
    fake_cluster.apply(campaign("many", namespace, 20, 10, parallelism=100))
    eventually(lambda: finished(fake_cluster, namespace, "many"), 120, operator.told)
    wrote = write_requests(fake_cluster, begin, namespace)
    ours = sum(count for key, count in wrote.items() if key.startswith(ACCOUNT))
    assert 5 <= ours <= 0.05 * 200 + 15, wrote
    assert 5 <= wrote.total() / 200 <= 6.8, wrote
    cpu, memory = operator.usage()
    assert 20 <= memory / 2**20 <= 100
    assert cpu <= 8, "its own start included"
    size = len(fake_cluster.kubectl("-n", namespace, "get", "campaign", "many", "--output=json"))
    assert size <= 12_000
    state = status(fake_cluster, namespace, "many")
    assert (state["progress"], state["state"]) == ("200/200", "Finished")
    assert condition(state, "Passed")["status"] == "True"
    before = fake_cluster.get("campaign", "many", f"--namespace={namespace}")
    fake_cluster.kubectl(*("--namespace", namespace, "label", "campaign", "many", "looked=at"))
    with pytest.raises(AssertionError):
        eventually(lambda: status(fake_cluster, namespace, "many") != state, 3)
    after = fake_cluster.get("campaign", "many", f"--namespace={namespace}")
    assert before["status"] == after["status"]


def test_pods_go_to_the_nodes_that_a_campaign_requires(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """With a share of memory, disk and GPUs that the document asks for, which the server takes."""
    nodes: Any = fake_cluster.get("nodes")
    name = nodes["items"][0]["metadata"]["name"]
    host = {"key": "kubernetes.io/hostname"}
    affinity = {
        "required": [{**host, "values": [name]}],
        "preferred": [{"key": "fast", "operator": "Exists", "weight": 5}],
    }
    spreads = [{"topologyKey": host["key"], "whenUnsatisfiable": "DoNotSchedule"}]
    made = campaign(
        "few", namespace, 3, 2, scheduling={"nodeAffinity": affinity, "topologySpread": spreads}
    )
    made["spec"]["vast"]["execution"] |= {
        "resources": {"shm_size": "1Gi"},
        "kubernetes": {"ephemeral_storage": "1Gi"},
    }
    fake_cluster.apply(made)
    operator = new_operator()
    operator.start()
    eventually(lambda: finished(fake_cluster, namespace, "few"), 60, operator.told)
    pods: Any = fake_cluster.get(
        "pods", f"--namespace={namespace}", "--selector=robovast.io/role=shard"
    )
    assert {pod["spec"]["nodeName"] for pod in pods["items"]} == {name}


def test_an_admin_sees_health_and_figures_but_no_series_per_campaign(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    port = free_port()
    operator = new_operator(ROBOVAST_PORT=str(port))
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), 60, operator.told)
    assert page(port, "healthz") == page(port, "readyz") == "ok"
    figures = page(port, "metrics")
    assert 'robovast_runs{state="passed"}' in figures
    assert 'resource="jobs"' in figures
    assert "robovast_leader 1.0" in figures
    assert "few" not in figures
    mine = f'robovast_namespace_runs{{campaign_namespace="{namespace}",state="passed"}}'
    assert mine in figures


def test_a_leader_that_is_killed_is_followed_by_the_other_replica(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess, new_operator: NewOperator
) -> None:
    eventually(lambda: "one leads" in operator.told(), 30, operator.told)
    other = new_operator("two")
    other.start()
    eventually(lambda: "one leads" in other.told(), 30, other.told)
    operator.kill()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), 60, other.told)
    jobs = fake_cluster.get("jobs", f"--namespace={namespace}")["items"]
    assert len(list(jobs)) == 2  # type: ignore[call-overload]
    assert "two leads" in other.told()


def test_a_namespace_goes_while_the_operator_is_down(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), 60, operator.told)
    operator.kill()
    fake_cluster.kubectl("delete", "namespace", namespace, "--timeout=60s")
    fake_cluster.kubectl("create", "namespace", namespace)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="clocks are shifted by code for x86-64")
def test_an_operator_whose_clock_jumps_goes_by_the_servers(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """Jobs that are kept for some time are not removed at once, and times in a status are right."""
    fake_cluster.apply(campaign("few", namespace, 3, 2, ttlSecondsAfterFinished=600))
    eventually(lambda: finished(fake_cluster, namespace, "few"), 60, operator.told)
    with operator.shifted(3600):
        fake_cluster.kubectl("--namespace", namespace, "label", "campaign", "few", "looked=at")
        fake_cluster.apply(campaign("later", namespace, 3, 2, suspend=True))
        eventually(lambda: status(fake_cluster, namespace, "later").get("state") == "Suspended")
        time.sleep(3)
    assert fake_cluster.kubectl("--namespace", namespace, "get", "jobs", "--output=name")
    told = condition(status(fake_cluster, namespace, "later"), "Succeeded")["lastTransitionTime"]
    assert parse_time(told) - datetime.now(UTC) < timedelta(minutes=1)


def test_a_job_that_somebody_deletes_is_made_again(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    fake_cluster.apply(campaign("few", namespace, 3, 2, suspend=True))
    eventually(lambda: status(fake_cluster, namespace, "few").get("state") == "Suspended")
    patch = json.dumps({"spec": {"suspend": False, "scheduling": {"nodeSelector": {"no": "node"}}}})
    fake_cluster.kubectl(
        *("--namespace", namespace, "patch", "campaign", "few", "--type=merge", f"--patch={patch}")
    )

    def uid() -> str:
        query = "--output=jsonpath={.items[*].metadata.uid}"
        return fake_cluster.kubectl("--namespace", namespace, "get", "jobs", query)

    first = eventually(uid, 30, operator.told)
    fake_cluster.kubectl("--namespace", namespace, "delete", "job", "--all")
    eventually(lambda: uid() not in {"", first}, 30, operator.told)
