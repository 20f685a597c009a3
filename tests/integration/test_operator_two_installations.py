"""Two installations that watch the same namespaces."""

from __future__ import annotations

import http.client
import json
from typing import Any

import pytest
from robovast_testbed import kwok
from robovast_testbed.errors import StartFailed
from robovast_testbed.helm import helm
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import CHART, rendered
from support.kube.operator_process import (
    SYSTEM,
    NewOperator,
    campaign,
    finished,
    free_port,
    page,
    status,
)
from support.patience import eventually

OTHER = "robovast-other"
ROLES = {"Role", "RoleBinding"}
CLUSTER_ROLES = {"ClusterRole", "ClusterRoleBinding"}


def give_rights(cluster: Cluster, installation: str) -> None:
    """Give another installation its rights; its Lease is written by the account of the tests."""
    account = {"kind": "ServiceAccount", "name": "robovast-operator", "namespace": SYSTEM}
    for obj in rendered(namespace=installation):
        kind, name = obj["kind"], obj["metadata"]["name"]
        if kind in ROLES and name == "robovast-operator-lease":
            obj["metadata"]["namespace"] = installation
            if kind == "RoleBinding":
                obj["subjects"] = [account]
            cluster.apply(obj)
        elif kind in CLUSTER_ROLES and name.endswith(f"-{installation}"):
            cluster.apply(obj)


def test_the_second_installation_writes_nothing_until_the_first_one_has_ended(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Neither Leases of users nor nodes of another system change that."""
    port = free_port()
    first = new_operator("first", ROBOVAST_NAMESPACES="")
    second = new_operator("second", POD_NAMESPACE=OTHER, ROBOVAST_PORT=str(port))
    fake_cluster.kubectl("create", "namespace", OTHER)
    fake_cluster.apply(lease_of_a_user(namespace), WINDOWS)
    second.start()
    eventually(lambda: "Role robovast-operator-lease" in page_with_errors(port), told=second.told)
    first.start()
    eventually(lambda: "first leads" in first.told(), told=first.told)
    give_rights(fake_cluster, OTHER)
    eventually(lambda: f"in the namespace {SYSTEM}" in page_with_errors(port), told=second.told)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=first.told)
    pods: Any = fake_cluster.get("pods", f"--namespace={namespace}")
    nodes = {pod["spec"]["nodeName"] for pod in pods["items"]}
    assert nodes
    assert "windows" not in nodes
    fake_cluster.kubectl("delete", "node", "windows")
    assert "second leads" not in second.told()
    assert "robovast_operator_blocked 1.0" in page(port, "metrics")
    first.kill()
    eventually(lambda: "second leads" in second.told(), told=second.told)
    fake_cluster.apply(campaign("newer", namespace, 2, 2))
    eventually(lambda: finished(fake_cluster, namespace, "newer"), told=second.told)
    assert status(fake_cluster, namespace, "newer")["progress"] == "4/4"
    first.start()
    eventually(lambda: f"in the namespace {OTHER}" in first.told(), told=first.told)
    assert first.told().count("first leads") == 1


def lease_of_a_user(namespace: str) -> dict[str, Any]:
    """A Lease of an operator's name, of somebody who is none."""
    return {
        "apiVersion": "coordination.k8s.io/v1",
        "kind": "Lease",
        "metadata": {"name": "robovast-operator", "namespace": namespace},
        "spec": {
            "holderIdentity": "a-user",
            "leaseDurationSeconds": 300,
            "renewTime": "2999-01-01T00:00:00.000000Z",
        },
    }


WINDOWS = {
    "apiVersion": "v1",
    "kind": "Node",
    "metadata": {
        "name": "windows",
        "annotations": {kwok.ANNOTATION: "fake"},
        "labels": {"kubernetes.io/os": "windows", "kubernetes.io/arch": "amd64"},
    },
    "status": {"allocatable": kwok.CAPACITY, "capacity": kwok.CAPACITY},
}
"""A simulated node that has more room than all others, since no pod is on it."""


def page_with_errors(port: int) -> str:
    """The answer of /readyz, whatever its status."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    try:
        connection.request("GET", "/readyz")
        return connection.getresponse().read().decode()
    except OSError:
        return ""
    finally:
        connection.close()


@pytest.mark.parametrize(
    ("own", "theirs", "refused"),
    [
        ([], "", True),
        (["a"], "", True),
        ([], "a", True),
        (["a", "b"], "b,c", True),
        (["a"], "b", False),
    ],
)
def test_helm_refuses_a_second_installation_with_a_common_namespace(
    fake_cluster: Cluster, namespace: str, own: list[str], theirs: str, refused: bool
) -> None:
    labels = {"app.kubernetes.io/name": "robovast"}
    container = {
        "name": "operator",
        "image": "operator",
        "env": [{"name": "ROBOVAST_NAMESPACES", "value": theirs}],
    }
    deployment = {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {"name": "robovast-operator", "namespace": namespace, "labels": labels},
        "spec": {
            "replicas": 1,
            "selector": {"matchLabels": labels},
            "template": {"metadata": {"labels": labels}, "spec": {"containers": [container]}},
        },
    }
    fake_cluster.kubectl("apply", "-f", "-", stdin=json.dumps(deployment))
    values = {"operator": {"namespaces": own}, "crds": {"enabled": False}}
    try:
        if refused:
            with pytest.raises(ValueError, match=f"in the namespace {namespace}, already manages"):
                rendered(values, fake_cluster, "second-system")
        else:
            assert rendered(values, fake_cluster, "second-system")
    finally:  # charts of other tests look for it
        fake_cluster.kubectl(
            "delete", "deployment", "robovast-operator", f"--namespace={namespace}"
        )


def test_helm_installs_one_release_and_keeps_the_keys_with_the_volume(
    fake_cluster: Cluster, namespace: str
) -> None:
    """The other release would work in the same namespace."""
    fake_cluster.kubectl("create", "namespace", f"{namespace}-b")
    shared = ("--set", "crds.enabled=false", "--set", f"operator.namespaces={{{namespace}}}")

    def install(release: str, where: str) -> None:
        helm(fake_cluster, "install", release, CHART, "--namespace", where, *shared)

    def keys() -> dict[str, str]:
        found: Any = fake_cluster.get("secret", "robovast-storage", f"--namespace={namespace}")
        return dict(found["data"])

    install("robovast", namespace)
    try:
        with pytest.raises(StartFailed, match=f"in the namespace {namespace}, already manages"):
            install("robovast", f"{namespace}-b")
        before = keys()
        helm(fake_cluster, "uninstall", "robovast", "--namespace", namespace)
        assert keys() == before
        install("robovast", namespace)
        assert keys() == before
        assert "robovast-s3" in fake_cluster.kubectl("get", "pvc", f"--namespace={namespace}")
    finally:
        helm(fake_cluster, "uninstall", "robovast", "--namespace", namespace)
        fake_cluster.kubectl("delete", "namespace", f"{namespace}-b", "--wait=false")
