"""Campaigns in namespaces with a ResourceQuota or a LimitRange."""

from __future__ import annotations

import json
from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import NewOperator, campaign, condition, finished, status
from support.patience import eventually


def limited(name: str, namespace: str, variants: int, runs: int) -> dict[str, Any]:
    """A Campaign that states all limits of its own container."""
    obj = campaign(name, namespace, variants, runs)
    obj["spec"]["vast"]["execution"]["resources"] = {"cpu": "100m", "memory": "128Mi"}
    return obj


def quota(namespace: str, **hard: str) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "ResourceQuota",
        "metadata": {"name": "compute", "namespace": namespace},
        "spec": {"hard": hard},
    }


def limit_range(namespace: str, **limits: dict[str, str]) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "LimitRange",
        "metadata": {"name": "bounds", "namespace": namespace},
        "spec": {"limits": [{"type": "Container", **limits}]},
    }


def test_a_campaign_finishes_where_a_quota_requires_every_limit(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    hard = {
        "limits.cpu": "4",
        "limits.memory": "8Gi",
        "requests.cpu": "4",
        "requests.memory": "8Gi",
    }
    fake_cluster.apply(quota(namespace, **hard))
    operator = new_operator()
    operator.start()
    fake_cluster.apply(limited("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)


def test_a_completed_job_of_ours_never_blocks_a_quota_of_jobs(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    fake_cluster.apply(quota(namespace, **{"count/jobs.batch": "1"}))
    operator = new_operator()
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    fake_cluster.apply(campaign("many", namespace, 30, 2))
    eventually(
        lambda: (
            (status(fake_cluster, namespace, "many").get("runs") or {}).get("active")
            or (status(fake_cluster, namespace, "many").get("shards"))
        ),
        told=operator.told,
    )


def test_a_new_leader_needs_no_room_in_a_quota_for_what_exists(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Kubernetes checks quotas before names, so it does not say that an object exists."""
    first = new_operator("first")
    first.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=first.told)
    first.stop()
    fake_cluster.apply(quota(namespace, configmaps="1"))
    used = ("get", "resourcequota", "compute", f"--namespace={namespace}")
    eventually(lambda: fake_cluster.kubectl(*used, "--output=jsonpath={.status.used.configmaps}"))
    address = "http://127.0.0.2:9"
    second = new_operator("second", ROBOVAST_S3_ENDPOINT=address, ROBOVAST_STALL_SECONDS="2")
    second.start()
    eventually(
        lambda: status(fake_cluster, namespace, "few").get("endpoint") == address,
        told=second.told,
    )
    assert condition(status(fake_cluster, namespace, "few"), "Stalled")["status"] == "False"
    assert "exceeded quota" not in second.told()


def test_a_limit_range_is_explained_and_the_chart_has_the_value_to_change(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    fake_cluster.apply(
        limit_range(namespace, min={"cpu": "20m"}, maxLimitRequestRatio={"memory": "2"})
    )
    operator = new_operator(ROBOVAST_STALL_SECONDS="2")
    operator.start()
    fake_cluster.apply(limited("few", namespace, 3, 2))

    def message() -> str:
        stalled = condition(status(fake_cluster, namespace, "few"), "Stalled")
        return stalled.get("message", "") if stalled.get("status") == "True" else ""

    told = eventually(message, told=operator.told)
    assert "LimitRange `bounds` requires at least 20m for requests.cpu, not 10m" in told
    assert "`agent.resources.requests.cpu` of the Helm chart" in told
    assert "ratio of limits.memory" in told
    operator.stop()
    own = {"requests": {"cpu": "20m", "memory": "256Mi"}, "limits": {"memory": "512Mi"}}
    resources = dict.fromkeys(
        ("ROBOVAST_AGENT_RESOURCES", "ROBOVAST_TASK_RESOURCES"), json.dumps(own)
    )
    operator = new_operator(**resources)
    operator.start()
    fake_cluster.kubectl("delete", "campaign", "few", f"--namespace={namespace}")
    fake_cluster.apply(limited("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
