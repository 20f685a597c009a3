"""The testbed's real node: pods, names, storage, Kueue."""

import json

import pytest
from robovast_testbed import images
from robovast_testbed.kubernetes import Cluster, Manifest
from robovast_testbed.s3 import Server

RESTRICTED = {
    "allowPrivilegeEscalation": False,
    "capabilities": {"drop": ["ALL"]},
    "readOnlyRootFilesystem": True,
    "runAsNonRoot": True,
    "seccompProfile": {"type": "RuntimeDefault"},
}


def job(
    name: str,
    script: str,
    *,
    completions: int = 1,
    memory: str = "256Mi",
    queue: str | None = None,
) -> Manifest:
    """Return an Indexed Job that runs a shell script in the slim image."""
    container = {
        "name": "run",
        "image": images.SLIM,
        "imagePullPolicy": "Never",
        "command": ["bash", "-c", script],
        "securityContext": RESTRICTED,
        "resources": {"requests": {"cpu": "10m"}, "limits": {"memory": memory}},
    }
    pod = {"restartPolicy": "Never", "containers": [container], "enableServiceLinks": False}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {
            "name": name,
            "namespace": "default",
            "labels": {"kueue.x-k8s.io/queue-name": queue} if queue else {},
        },
        "spec": {
            "completionMode": "Indexed",
            "completions": completions,
            "parallelism": completions,
            "backoffLimit": 0,
            "suspend": queue is not None,
            "template": {"spec": pod},
        },
    }


def finish(cluster: Cluster, name: str) -> str:
    """Wait for a Job and return what its first pod wrote."""
    cluster.kubectl("wait", f"job/{name}", "--for=condition=Complete", "--timeout=180s")
    return cluster.kubectl("logs", f"job/{name}")


def test_indexed_job_completes_on_the_node(cluster: Cluster) -> None:
    cluster.apply(job("indexed", "echo $JOB_COMPLETION_INDEX", completions=3))

    finish(cluster, "indexed")

    status = cluster.get("job/indexed")["status"]
    assert isinstance(status, dict)
    assert status["completedIndexes"] == "0-2"


def test_pods_find_services_by_name(cluster: Cluster) -> None:
    probe = "import socket; print(socket.gethostbyname('kubernetes.default.svc.cluster.local'))"
    cluster.apply(job("names", f'python3 -c "{probe}"'))

    assert finish(cluster, "names").strip() == "10.96.0.1"


def test_pods_reach_services(cluster: Cluster) -> None:
    probe = "import socket; socket.create_connection(('kubernetes.default', 443)).close()"
    cluster.apply(job("services", f'python3 -c "{probe}" && echo reached'))

    assert finish(cluster, "services").strip() == "reached"


def test_pods_reach_the_object_store(cluster: Cluster, cluster_s3: Server) -> None:
    host, _, port = cluster_s3.inner_endpoint.partition(":")
    name = f"store-{cluster_s3.make}"
    probe = f"import socket; socket.create_connection(('{host}', {port})).close()"
    cluster.apply(job(name, f'python3 -c "{probe}" && echo reached'))

    assert finish(cluster, name).strip() == "reached"


def test_memory_limits_hold(cluster: Cluster) -> None:
    greedy = job("greedy", 'python3 -c "bytearray(200 << 20)"', memory="64Mi")
    cluster.apply(greedy)

    cluster.kubectl("wait", "job/greedy", "--for=condition=Failed", "--timeout=180s")

    assert '"reason": "OOMKilled"' in json.dumps(cluster.get("pods", "-l", "job-name=greedy"))


def test_volumes_are_provisioned(cluster: Cluster) -> None:
    claim = {
        "apiVersion": "v1",
        "kind": "PersistentVolumeClaim",
        "metadata": {"name": "claim", "namespace": "default"},
        "spec": {
            "accessModes": ["ReadWriteOnce"],
            "resources": {"requests": {"storage": "1Mi"}},
        },
    }
    cluster.apply(claim)

    cluster.kubectl("wait", "pvc/claim", "--for=jsonpath={.status.phase}=Bound", "--timeout=180s")


@pytest.fixture
def queue(kueue_cluster: Cluster) -> str:
    flavor = {
        "apiVersion": "kueue.x-k8s.io/v1beta1",
        "kind": "ResourceFlavor",
        "metadata": {"name": "any"},
    }
    quota = {"cpu": "1", "memory": "1Gi"}
    resources = [{"name": name, "nominalQuota": amount} for name, amount in quota.items()]
    cluster_queue = {
        "apiVersion": "kueue.x-k8s.io/v1beta1",
        "kind": "ClusterQueue",
        "metadata": {"name": "all"},
        "spec": {
            "namespaceSelector": {},
            "resourceGroups": [
                {
                    "coveredResources": list(quota),
                    "flavors": [{"name": "any", "resources": resources}],
                }
            ],
        },
    }
    local_queue = {
        "apiVersion": "kueue.x-k8s.io/v1beta1",
        "kind": "LocalQueue",
        "metadata": {"name": "tests", "namespace": "default"},
        "spec": {"clusterQueue": "all"},
    }
    kueue_cluster.apply(flavor, cluster_queue, local_queue)
    return "tests"


def test_kueue_admits_a_suspended_job(kueue_cluster: Cluster, queue: str) -> None:
    kueue_cluster.apply(job("queued", "echo admitted", queue=queue))

    assert finish(kueue_cluster, "queued").strip() == "admitted"
    workloads = json.dumps(kueue_cluster.get("workloads.kueue.x-k8s.io"))
    assert '"reason": "Admitted"' in workloads
