"""Campaigns whose S3 server gets another address."""

from __future__ import annotations

from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.chart import of_kind, rendered
from support.kube.operator_process import NewOperator, campaign, finished, status
from support.patience import eventually

OLD = "http://127.0.0.1:9"
NEW = "http://127.0.0.2:9"


def settings(endpoint: str) -> dict[str, str]:
    """The operator's variables as `helm upgrade` with this address writes them."""
    storage = {"embedded": {"enabled": False}, "external": {"endpoint": endpoint}}
    deployment = of_kind(rendered({"storage": storage}), "Deployment")["robovast-operator"]
    (container,) = deployment["spec"]["template"]["spec"]["containers"]
    found = {item["name"]: item.get("value", "") for item in container["env"]}
    return {name: found[name] for name in ("ROBOVAST_S3_ENDPOINT", "ROBOVAST_S3_REGION")}


def jobs(cluster: Cluster, namespace: str) -> list[dict[str, Any]]:
    """The Jobs of runs that are not being deleted."""
    of_runs = "--selector=robovast.io/role=shard"
    found: Any = cluster.get("jobs", f"--namespace={namespace}", of_runs)
    return [job for job in found["items"] if "deletionTimestamp" not in job["metadata"]]


def addresses(job: dict[str, Any]) -> set[str]:
    """The values of the agent's variable with the S3 server."""
    agent = next(c for c in job["spec"]["template"]["spec"]["containers"] if c["name"] == "agent")
    return {e["value"] for e in agent["env"] if e["name"] == "ROBOVAST_S3_ENDPOINT"}


def test_an_open_campaign_continues_with_the_new_address_and_a_finished_one_shows_it(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    first = new_operator("first", **settings(OLD))
    first.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=first.told)
    fake_cluster.apply(campaign("busy", namespace, 10, 1, parallelism=10))
    own = campaign("own", namespace, 2, 1, suspend=True, storage={"endpoint": OLD})
    fake_cluster.apply(own)
    eventually(
        lambda: status(fake_cluster, namespace, "busy").get("runs", {}).get("active"),
        told=first.told,
    )
    bucket = status(fake_cluster, namespace, "busy")["bucket"]
    first.stop()
    second = new_operator("second", **settings(NEW))
    second.start()

    def recreated() -> bool:
        busy = [job for job in jobs(fake_cluster, namespace) if "busy" in job["metadata"]["name"]]
        return [addresses(job) for job in busy] == [{NEW}]

    eventually(recreated, told=second.told)
    moved = ("get", "events", f"--namespace={namespace}", "--field-selector=reason=StorageMoved")
    assert NEW in fake_cluster.kubectl(*moved, "--output=jsonpath={.items[*].message}")
    pods = ("--namespace", namespace, "label", "pods", "--selector=robovast.io/campaign=busy")

    def ended() -> bool:
        fake_cluster.kubectl(*pods, "--overwrite", "go=on")
        return finished(fake_cluster, namespace, "busy")

    eventually(ended, 120, second.told)
    state = status(fake_cluster, namespace, "busy")
    assert (state["endpoint"], state["bucket"], state["progress"]) == (NEW, bucket, "10/10")
    eventually(lambda: status(fake_cluster, namespace, "few")["endpoint"] == NEW, told=second.told)
    assert status(fake_cluster, namespace, "own").get("endpoint") == OLD
    plans: Any = fake_cluster.get("configmaps", f"--namespace={namespace}")
    told = [text for plan in plans["items"] for text in plan.get("data", {}).values()]
    assert not any(address in text for text in told for address in (OLD, NEW))
