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
    eventually(lambda: finished(fake_cluster, namespace, "many"), told=operator.told)
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


def test_runs_that_are_not_needed_are_counted_apart_as_their_pods_say(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    runs = {"min": 3, "max": 50, "decide": {"good": 0.05, "bad": 0.2, "error": 0.05}}
    made = campaign("needed", namespace, 3, runs)
    fake_cluster.apply(made)
    eventually(lambda: finished(fake_cluster, namespace, "needed"), told=operator.told)
    state = status(fake_cluster, namespace, "needed")
    assert (state["progress"], state["state"]) == ("54/54", "Finished")
    assert (state["runs"]["total"], state["runs"]["notNeeded"]) == (150, 96)
    assert state["shards"][0]["notNeeded"] == 96
    assert state["decisions"] == "3 passing after 18"
    assert condition(state, "Passed")["status"] == "True"
    execution = made["spec"]["vast"]["execution"]
    execution["runs"] = {**runs, "decide": {**runs["decide"], "good": 0.1}}
    fake_cluster.apply(made)
    told = eventually(
        lambda: (
            condition(status(fake_cluster, namespace, "needed"), "Accepted").get("reason")
            != "Valid"
        )
    )
    assert told
    refused = condition(status(fake_cluster, namespace, "needed"), "Accepted")
    assert refused["reason"] == "DocumentChanged"


def test_packs_are_planned_in_rounds_by_what_pods_took_and_a_killed_operator_goes_on(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess, new_operator: NewOperator
) -> None:
    made = campaign("measured", namespace, 5, 60, parallelism=10)
    made["spec"]["vast"]["execution"]["runs_per_job"] = "auto"
    fake_cluster.apply(made)

    def rounds() -> list[tuple[int, int]]:
        maps: Any = fake_cluster.get("configmaps", f"--namespace={namespace}")
        texts = [(item.get("data") or {}).get("campaign.json") for item in maps["items"]]
        plans = [json.loads(text)["plan"] for text in texts if text]
        longest = max((plan["rounds"] for plan in plans), key=len, default=[])
        return [(round_["runs"], round_["size"]) for round_ in longest]

    eventually(rounds, told=operator.told)
    operator.kill()
    after = new_operator("two")
    after.start()
    eventually(lambda: finished(fake_cluster, namespace, "measured"), told=after.told)
    state = status(fake_cluster, namespace, "measured")
    assert (state["progress"], state["state"]) == ("300/300", "Finished")
    assert [shard["passed"] for shard in state["shards"]] == [runs for runs, _ in rounds()]
    sizes = [size for _, size in rounds()]
    assert sizes[0] == 1
    assert 10 <= max(sizes) <= 16
    assert sizes[-1] <= max(sizes)


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
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
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
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
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
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=other.told)
    jobs = fake_cluster.get("jobs", f"--namespace={namespace}")["items"]
    assert len(list(jobs)) == 2  # type: ignore[call-overload]
    assert "two leads" in other.told()


def test_a_namespace_goes_while_the_operator_is_down(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    operator.kill()
    fake_cluster.kubectl("delete", "namespace", namespace, "--timeout=60s")
    fake_cluster.kubectl("create", "namespace", namespace)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="clocks are shifted by code for x86-64")
def test_an_operator_whose_clock_jumps_goes_by_the_servers(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """Jobs that are kept for some time are not removed at once, and times in a status are right."""
    fake_cluster.apply(campaign("few", namespace, 3, 2, ttlSecondsAfterFinished=600))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
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


def test_an_upload_of_earlier_results_is_ended_before_newer_ones_are_uploaded(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    made: Any = fake_cluster.get("jobs", f"--namespace={namespace}")["items"]
    (finish,) = (job for job in made if job["metadata"]["labels"]["robovast.io/role"] == "finish")
    name, labels = finish["metadata"]["name"], finish["metadata"]["labels"]
    early = name.replace("finish-1", "share-1-0")
    own = {k: v for k, v in labels.items() if "batch" not in k and k != "job-name"}
    container = {"name": "share", "image": "fake"}
    pod = {"spec": {"restartPolicy": "Never", "containers": [container]}}
    fake_cluster.apply(
        {
            "apiVersion": "batch/v1",
            "kind": "Job",
            "metadata": {
                "name": early,
                "namespace": namespace,
                "labels": {**own, "robovast.io/role": "share"},
            },
            "spec": {"suspend": True, "template": pod},
        }
    )
    patch = json.dumps({"spec": {"share": {"secretName": "robovast-share"}}})
    fake_cluster.kubectl(
        *("--namespace", namespace, "patch", "campaign", "few", "--type=merge", f"--patch={patch}")
    )

    def uploads() -> list[str]:
        selector = "--selector=robovast.io/role=share"
        found: Any = fake_cluster.get("jobs", f"--namespace={namespace}", selector)["items"]
        return [job["metadata"]["name"] for job in found]

    late = early.replace("share-1-0", "share-1-1")
    eventually(lambda: uploads() == [late], 30, lambda: (uploads(), operator.told()))


def test_campaigns_of_one_name_and_second_in_two_namespaces_replace_no_archive_of_the_other(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """As one manifest that is applied to both; they may have one share."""
    other = f"{namespace}-b"
    fake_cluster.kubectl("create", "namespace", other)
    places = (namespace, other)
    share = {"secretName": "robovast-share"}
    made = [campaign("few", place, 3, 2, suspend=True, share=share) for place in places]

    def created_at_once() -> bool:
        fake_cluster.apply(*made)
        found = [fake_cluster.get("campaign", "few", f"--namespace={place}") for place in places]
        same = len({item["metadata"]["creationTimestamp"] for item in found}) == 1
        for place in () if same else places:
            fake_cluster.kubectl("delete", "campaign/few", f"--namespace={place}")
        return same

    def archives() -> list[str]:
        selector = "--selector=robovast.io/role=share"
        jobs = [
            job
            for p in places
            for job in fake_cluster.get("jobs", f"--namespace={p}", selector)["items"]
        ]
        commands = [job["spec"]["template"]["spec"]["containers"][0]["command"] for job in jobs]
        return [word for words in commands for word in words if word.startswith("--campaign=")]

    try:
        eventually(created_at_once)
        operator = new_operator(ROBOVAST_NAMESPACES=",".join(places))
        operator.start()
        for place in places:
            eventually(lambda place=place: status(fake_cluster, place, "few").get("campaign"))
        for place in places:
            go = ("patch", "campaign/few", "--type=merge", '--patch={"spec":{"suspend":false}}')
            fake_cluster.kubectl(*go, f"--namespace={place}")
        told = eventually(lambda: (a := archives()) and len(a) == 2 and a, told=operator.told)
        assert len(set(told)) == 2
    finally:
        fake_cluster.kubectl("delete", "namespace", other, "--wait=false")
