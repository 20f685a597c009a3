"""A thousand objects that make no sense."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from typing import Any

from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    campaign,
    condition,
    created,
    finished,
    free_port,
    page,
    status,
)
from support.kube.requests import Requests
from support.patience import eventually

GROUP = "/apis/robovast.io/v1beta1"
KINDS = ("Campaign", "Configuration")
MIB = 2**20
ROUND = 150
"""Objects that come and go together."""


def malformed(namespace: str, count: int) -> Iterator[dict[str, Any]]:
    """Objects that the API server takes and that cannot be executed; some are large."""
    good = campaign("good", namespace, 1, 1)
    vast = good["spec"]["vast"]
    large = {"inline": {"files": {"data.csv": "0123456789abcdef" * 12_500}}}
    execution = vast["execution"]
    faults: list[dict[str, Any]] = [
        {"vast": {**vast, "excution": {}}},
        {"vast": {**vast, "configuration": [{"name": "a", "parameters": [{"nothing": 1}]}]}},
        {"vast": {**vast, "configuration": [{"name": "a", "variations": [{"NoSuch": {}}]}]}},
        {"vast": {**vast, "execution": {**execution, "scenario_file": "nowhere.osc"}}},
        {"vast": {**vast, "execution": {**execution, "pre_command": "/config/nowhere.sh"}}},
        {"vast": {**vast, "execution": {**execution, "env": [{"CAMPAIGN_ID": "x"}]}}},
        {"source": {"configMap": {"name": "nowhere"}}},
        {"select": ["no-such-*"]},
        {"campaign": "nobody", "parameters": [{"x": 1}]},
    ]
    for number in range(count):
        fault = {"source": large} if number % 50 == 0 else faults[number % len(faults)]
        kind = "Configuration" if "campaign" in fault else "Campaign"
        yield {
            "apiVersion": "robovast.io/v1beta1",
            "kind": kind,
            "metadata": {"name": f"bad-{number}", "namespace": namespace},
            "spec": fault if kind == "Configuration" else {**good["spec"], **fault},
        }


def malformed_jobs(namespace: str) -> Iterator[dict[str, Any]]:
    """Jobs with the operator's label that anybody who may make Jobs can leave."""
    ours = {"app.kubernetes.io/managed-by": "robovast"}
    pod = {"restartPolicy": "Never", "containers": [{"name": "x", "image": "x"}]}
    labels = [
        {"robovast.io/shard": "first"},
        {"robovast.io/shard": "9" * 60, "robovast.io/campaign": "few"},
        {"robovast.io/campaign": "nobody", "robovast.io/campaign-uid": "x"},
        {},
    ]
    for number, more in enumerate(labels):
        yield {
            "apiVersion": "batch/v1",
            "kind": "Job",
            "metadata": {
                "name": f"stray-{number}",
                "namespace": namespace,
                "labels": {**ours, **more},
                "annotations": {"robovast.io/attempt": "x", "robovast.io/runs": "x"},
            },
            "spec": {"suspend": True, "template": {"spec": pod}},
        }


def test_a_stray_job_with_our_label_stops_nobody(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Neither when it comes, nor when the operator finds it at its start."""
    requests = Requests(fake_cluster, "tester")
    for job in malformed_jobs(namespace):
        requests.post(f"/apis/batch/v1/namespaces/{namespace}/jobs", job)
    requests.close()
    port = free_port()
    operator = new_operator(ROBOVAST_PORT=str(port), ROBOVAST_RESYNC_SECONDS="2")
    operator.start()
    eventually(lambda: "ok" in page(port, "readyz"), 30, operator.told)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert "ok" in page(port, "healthz")


def test_a_stray_job_with_all_labels_of_a_campaign_is_none_of_it(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """One that nothing can ever execute would hold the campaign back for ever."""
    operator = new_operator(ROBOVAST_RESYNC_SECONDS="2")
    operator.start()
    held = campaign("few", namespace, 3, 2)
    held["spec"]["suspend"] = True
    fake_cluster.apply(held)
    uid = fake_cluster.kubectl(
        "get", "campaign", "few", f"--namespace={namespace}", "--output=jsonpath={.metadata.uid}"
    )
    for role in ("shard", "finish", "compose"):
        job = next(malformed_jobs(namespace))
        job["metadata"]["name"] = f"stray-{role}"
        job["metadata"]["labels"] |= {
            "robovast.io/campaign": "few",
            "robovast.io/campaign-uid": uid,
            "robovast.io/role": role,
            "robovast.io/shard": "0",
        }
        fake_cluster.apply(job)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)


def test_a_document_that_is_nested_deeply_ends_no_watch(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """The API server takes 10,000 levels; who reads them may have less patience."""
    port = free_port()
    operator = new_operator(ROBOVAST_PORT=str(port), ROBOVAST_RESYNC_SECONDS="2")
    operator.start()
    deep = campaign("deep", namespace, 3, 2)
    deep["spec"]["vast"]["metadata"] = {"notes": "HERE"}
    text = json.dumps(deep).replace('"HERE"', '{"a":' * 3000 + "1" + "}" * 3000)
    fake_cluster.kubectl("create", "--validate=false", "-f", "-", stdin=text)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)

    def refused() -> bool:
        path = '{.status.conditions[?(@.type=="Accepted")].message}'
        where = f"--namespace={namespace}"
        told = fake_cluster.kubectl("get", "campaign", "deep", where, "-o", f"jsonpath={path}")
        return "nested too deeply" in told

    eventually(refused, 30, operator.told)
    assert "ok" in page(port, "healthz")


def test_malformed_objects_leave_nothing_and_hinder_nobody(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    port = free_port()
    operator = new_operator(
        ROBOVAST_LEASE_SECONDS="15", ROBOVAST_PORT=str(port), ROBOVAST_RESYNC_SECONDS="5"
    )
    operator.start()
    requests = Requests(fake_cluster, "tester")
    collections = [f"{GROUP}/namespaces/{namespace}/{kind.lower()}s" for kind in KINDS]

    def make(count: int) -> None:
        for obj in malformed(namespace, count):
            requests.post(f"{GROUP}/namespaces/{namespace}/{obj['kind'].lower()}s", obj)

    def told() -> bool:
        """Whether each Campaign has a condition that says why."""
        time.sleep(2)  # all of them are much to read
        states = [item.get("status") or {} for item in requests.get(collections[0])["items"]]
        return all(condition(state, "Accepted").get("message") for state in states)

    def forgotten() -> bool:
        figures = page(port, "metrics")
        return all(f'robovast_objects{{kind="{kind}"}} 0.0' in figures for kind in KINDS)

    def removed() -> bool:
        """Whether all are gone and forgotten; to remove many takes more than one request."""
        for collection in collections:
            with contextlib.suppress(StartFailed):
                fake_cluster.kubectl("delete", "--raw", collection)
        return forgotten()

    def left(count: int) -> int:
        """Memory after so many have come, have been answered, and have gone [byte]."""
        make(count)
        eventually(told, 300, operator.told)
        eventually(removed, told=operator.told)
        time.sleep(8)  # a comparison, after which what is free is given back
        return operator.memory()

    try:
        before = left(ROUND)
        after = left(ROUND)
        make(100)
        fake_cluster.apply(campaign("few", namespace, 3, 2))
        eventually(lambda: created(fake_cluster, namespace, "jobs"), 30, operator.told)
    finally:
        requests.close()
    assert after <= before + 10 * MIB


def test_a_job_of_others_that_has_the_name_of_a_shard_is_told_until_it_is_gone(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    operator = new_operator()
    fake_cluster.apply(campaign("hunted", namespace, 3, 2))
    uid = fake_cluster.kubectl(
        "get", "campaign", "hunted", f"--namespace={namespace}", "--output=jsonpath={.metadata.uid}"
    )
    job = next(malformed_jobs(namespace))
    name = job["metadata"]["name"] = f"hunted-{uid[:4]}-0"
    job["metadata"]["labels"] = {}
    fake_cluster.apply(job)
    operator.start()

    def told() -> bool:
        found = condition(status(fake_cluster, namespace, "hunted"), "Stalled")
        remedy = f"run `kubectl delete job -n {namespace} {name}`."
        return found.get("reason") == "NameConflict" and remedy in found.get("message", "")

    eventually(told, told=operator.told)
    fake_cluster.kubectl("delete", "job", name, f"--namespace={namespace}")

    def succeeded() -> bool:
        found = condition(status(fake_cluster, namespace, "hunted"), "Succeeded")
        return found.get("status") == "True"

    eventually(succeeded, told=operator.told)


def test_a_config_map_that_has_the_name_of_a_plan_is_told_and_others_go_on(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Somebody was faster, as who restores a backup; once it is gone the campaign goes on."""
    operator = new_operator(ROBOVAST_STALL_SECONDS="1")
    held = campaign("hunted", namespace, 3, 2)
    fake_cluster.apply(held)
    uid = fake_cluster.kubectl(
        "get", "campaign", "hunted", f"--namespace={namespace}", "--output=jsonpath={.metadata.uid}"
    )
    name = f"hunted-{uid[:4]}-plan-0"
    fake_cluster.kubectl("create", "configmap", name, f"--namespace={namespace}")
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)

    def told() -> bool:
        found = condition(status(fake_cluster, namespace, "hunted"), "Stalled")
        return name in found.get("message", "") and found["reason"] == "Invalid"

    eventually(told, told=operator.told)
    fake_cluster.kubectl("delete", "configmap", name, f"--namespace={namespace}")
    eventually(
        lambda: status(fake_cluster, namespace, "hunted").get("progress") == "6/6",
        120,
        operator.told,
    )
