"""Jobs that are executed in another cluster: the API server's rules are real, Kueue is played.

What fills `spec.managedBy` here is a policy instead of Kueue's webhook; the built-in controllers
leave such a Job alone, and the test brings its status as MultiKueue does.
"""

from __future__ import annotations

import json
from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    finished,
    status,
)
from support.patience import eventually

QUEUE = "far"
MANAGER = "kueue.x-k8s.io/multikueue"
BEGUN = "2026-01-01T00:00:00Z"
POLICY = {
    "apiVersion": "admissionregistration.k8s.io/v1",
    "kind": "MutatingAdmissionPolicy",
    "metadata": {"name": "far-away"},
    "spec": {
        "reinvocationPolicy": "Never",
        "failurePolicy": "Fail",
        "matchConstraints": {
            "resourceRules": [
                {
                    "apiGroups": ["batch"],
                    "apiVersions": ["v1"],
                    "operations": ["CREATE"],
                    "resources": ["jobs"],
                }
            ],
            "objectSelector": {"matchLabels": {"kueue.x-k8s.io/queue-name": QUEUE}},
        },
        "mutations": [
            {
                "patchType": "ApplyConfiguration",
                "applyConfiguration": {
                    "expression": f'Object{{spec: Object.spec{{managedBy: "{MANAGER}"}}}}'
                },
            }
        ],
    },
}
BINDING = {
    "apiVersion": "admissionregistration.k8s.io/v1",
    "kind": "MutatingAdmissionPolicyBinding",
    "metadata": {"name": "far-away"},
    "spec": {"policyName": "far-away"},
}


@pytest.fixture(scope="module")
def far_cluster(
    fake_cluster: Cluster,
) -> Cluster:
    """A cluster whose Jobs of the queue `far` are executed elsewhere; which holds soon."""
    fake_cluster.apply(POLICY, BINDING)
    probe = {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"name": "probe", "labels": {"kueue.x-k8s.io/queue-name": QUEUE}},
        "spec": {
            "suspend": True,
            "template": {
                "spec": {"restartPolicy": "Never", "containers": [{"name": "a", "image": "a"}]}
            },
        },
    }

    def is_mutated() -> bool:
        made = fake_cluster.kubectl(
            *("create", "--dry-run=server", "--output=json", "--filename=-"),
            stdin=json.dumps(probe),
        )
        return json.loads(made)["spec"].get("managedBy") == MANAGER

    eventually(is_mutated, 60, "the policy holds")
    return fake_cluster


@pytest.fixture
def operator(far_cluster: Cluster, new_operator: NewOperator) -> OperatorProcess:
    made = new_operator(ROBOVAST_STATUS_SECONDS="1")
    made.start()
    return made


def shard(cluster: Cluster, namespace: str, other_than: str = "") -> dict[str, Any]:
    """The Job of the campaign's runs, as soon as it is there."""

    def found() -> Any:
        selector = "--selector=robovast.io/role=shard"
        items: Any = cluster.get("jobs", selector, f"--namespace={namespace}")["items"]
        there = [item for item in items if item["metadata"]["uid"] != other_than]
        return there[0] if there else None

    made: dict[str, Any] = eventually(found, 60, "there is a Job")
    return made


def change(cluster: Cluster, job: dict[str, Any], content: Any, *options: str) -> None:
    name, namespace = job["metadata"]["name"], job["metadata"]["namespace"]
    patch = f"--patch={json.dumps(content)}"
    cluster.kubectl("--namespace", namespace, "patch", "job", name, "--type=merge", patch, *options)


def bring(cluster: Cluster, job: dict[str, Any], **told: Any) -> None:
    """Let the Job have quota, and the status that it has in another cluster."""
    change(cluster, job, {"spec": {"suspend": False}})
    content = {"status": {"startTime": BEGUN, **told}}
    change(cluster, job, content, "--subresource=status")


def ended(kind: str) -> dict[str, str]:
    return {
        "type": kind, "status": "True", "reason": "Ended", "message": "",
        "lastTransitionTime": BEGUN, "lastProbeTime": BEGUN,
    }  # fmt: skip


def test_a_campaign_is_told_of_by_the_status_of_jobs_whose_pods_nobody_sees(
    far_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """Six runs, of which some end before the other cluster is lost, and all in the next one."""
    cluster = far_cluster
    cluster.apply(campaign("few", namespace, 3, 2, queueName=QUEUE))
    job = shard(cluster, namespace)
    assert job["spec"]["managedBy"] == MANAGER
    assert "configMap" not in json.dumps(job["spec"]["template"]["spec"]["volumes"])

    bring(cluster, job, active=2, ready=2, completedIndexes="0", failedIndexes="1", succeeded=1)

    def runs() -> tuple[int, int, int]:
        found = status(cluster, namespace, "few").get("runs", {})
        return tuple(found.get(k, 0) for k in ("active", "passed", "undecided"))  # type: ignore[return-value]

    eventually(lambda: runs() == (2, 1, 1), told=operator.told)
    state = status(cluster, namespace, "few")
    assert condition(state, "Stalled")["status"] == "False"
    assert condition(state, "Succeeded")["status"] == "Unknown"

    change(cluster, job, {"spec": {"suspend": True}})  # Kueue gives the other cluster up
    another = shard(cluster, namespace, other_than=job["metadata"]["uid"])
    assert another["metadata"]["name"] == job["metadata"]["name"]
    assert another["spec"]["managedBy"] == MANAGER
    eventually(lambda: runs() == (0, 0, 0), told=operator.told)

    conditions = [ended("SuccessCriteriaMet"), ended("Complete")]
    whole = {"completedIndexes": "0-5", "succeeded": 6, "completionTime": BEGUN}
    bring(cluster, another, **whole, conditions=conditions)
    eventually(lambda: finished(cluster, namespace, "few"), told=operator.told)
    assert runs() == (0, 6, 0)
    pods: Any = cluster.get("pods", "--selector=robovast.io/role=shard", f"--namespace={namespace}")
    assert not pods["items"]
