"""Two installations that watch the same namespaces."""

from __future__ import annotations

import http.client
import json

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import rendered
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
RIGHTS = {"Role", "RoleBinding"}


@pytest.fixture
def other(fake_cluster: Cluster) -> str:
    """A namespace in which another installation may have its Lease."""
    fake_cluster.kubectl("create", "namespace", OTHER)
    account = {"kind": "ServiceAccount", "name": "robovast-operator", "namespace": SYSTEM}
    for obj in rendered(namespace=OTHER):
        if obj["kind"] in RIGHTS and obj["metadata"]["name"] == "robovast-operator-lease":
            obj["metadata"]["namespace"] = OTHER
            if obj["kind"] == "RoleBinding":
                obj["subjects"] = [account]
            fake_cluster.apply(obj)
    return OTHER


def test_the_second_installation_writes_nothing_until_the_first_one_has_ended(
    fake_cluster: Cluster, namespace: str, other: str, new_operator: NewOperator
) -> None:
    port = free_port()
    first = new_operator("first", ROBOVAST_NAMESPACES="")
    second = new_operator("second", POD_NAMESPACE=other, ROBOVAST_PORT=str(port))
    first.start()
    eventually(lambda: "first leads" in first.told(), told=first.told)
    second.start()
    eventually(lambda: f"in the namespace {SYSTEM}" in page_with_errors(port), told=second.told)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=first.told)
    assert "second leads" not in second.told()
    assert "robovast_operator_blocked 1.0" in page(port, "metrics")
    first.kill()
    eventually(lambda: "second leads" in second.told(), told=second.told)
    fake_cluster.apply(campaign("newer", namespace, 2, 2))
    eventually(lambda: finished(fake_cluster, namespace, "newer"), told=second.told)
    assert status(fake_cluster, namespace, "newer")["progress"] == "4/4"
    first.start()
    eventually(lambda: f"in the namespace {other}" in first.told(), told=first.told)
    assert first.told().count("first leads") == 1


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
            with pytest.raises(ValueError, match=f"in the namespace {namespace}, already works in"):
                rendered(values, fake_cluster, "second-system")
        else:
            assert rendered(values, fake_cluster, "second-system")
    finally:  # charts of other tests look for it
        fake_cluster.kubectl(
            "delete", "deployment", "robovast-operator", f"--namespace={namespace}"
        )
