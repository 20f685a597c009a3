"""Assets and devices on a real API server: who may have what, and what pods get."""

from __future__ import annotations

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


@pytest.fixture
def operator(fake_cluster: Cluster, namespace: str, new_operator: NewOperator) -> OperatorProcess:
    """An operator of a namespace with restricted pods."""
    fake_cluster.kubectl(
        "label", "namespace", namespace, "pod-security.kubernetes.io/enforce=restricted"
    )
    made = new_operator()
    made.start()
    return made


def with_assets(namespace: str, *assets: dict[str, str]) -> dict[str, Any]:
    """The campaign `few` with a secondary container."""
    made = campaign("few", namespace, 3, 2)
    execution = made["spec"]["vast"]["execution"]
    execution |= {"kubernetes": {"assets": list(assets)}, "secondary_containers": ["simulator"]}
    return made


def claim(namespace: str) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "PersistentVolumeClaim",
        "metadata": {"name": "worlds", "namespace": namespace},
        "spec": {
            "accessModes": ["ReadOnlyMany"],
            "volumeName": f"worlds-{namespace}",
            "storageClassName": "",
            "resources": {"requests": {"storage": "1Mi"}},
        },
    }


def volume(namespace: str) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "PersistentVolume",
        "metadata": {"name": f"worlds-{namespace}"},
        "spec": {
            "capacity": {"storage": "1Mi"},
            "accessModes": ["ReadOnlyMany"],
            "nfs": {"server": "127.0.0.1", "path": "/worlds"},
            "claimRef": {"name": "worlds", "namespace": namespace},
        },
    }


def rejection(cluster: Cluster, namespace: str, reason: str, operator: OperatorProcess) -> str:
    """Why the campaign `few` is not accepted, as soon as it is for this reason."""

    def found() -> str | None:
        told = condition(status(cluster, namespace, "few"), "Accepted")
        return told["message"] if told.get("reason") == reason else None

    said: str = eventually(found, told=operator.told)
    return said


def test_a_claim_is_mounted_once_it_is_there_and_its_owner_allows_that(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    def refused(reason: str) -> str:
        return rejection(fake_cluster, namespace, reason, operator)

    wanted = with_assets(
        namespace,
        {"path": "/assets/worlds", "claim": "worlds"},
        {"path": "/assets/models", "image": "models:1"},
    )
    fake_cluster.apply(wanted)
    assert "no PersistentVolumeClaim `worlds`" in refused("AssetsNotFound")
    fake_cluster.apply(volume(namespace), claim(namespace))
    message = refused("AssetsNotAllowed")
    label = f"label pvc -n {namespace} worlds robovast.io/assets=true"
    assert label in message
    assert not fake_cluster.get("jobs", f"--namespace={namespace}")["items"]
    fake_cluster.kubectl(*label.split())
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    pods: Any = fake_cluster.get(
        "pods", f"--namespace={namespace}", "--selector=robovast.io/role=shard"
    )
    spec = pods["items"][0]["spec"]
    volumes = {volume["name"]: volume for volume in spec["volumes"]}
    assert volumes["assets-0"]["persistentVolumeClaim"] == {"claimName": "worlds", "readOnly": True}
    assert volumes["assets-1"]["image"]["reference"] == "models:1"
    mounted = {
        container["name"]: {m["mountPath"] for m in container["volumeMounts"] if m.get("readOnly")}
        for container in (*spec["initContainers"], *spec["containers"])
        if any(m["name"].startswith("assets") for m in container.get("volumeMounts", ()))
    }
    both = {"/assets/worlds", "/assets/models", "/config"}
    assert mounted == {"robovast": both, "simulator": both}


def test_gpus_that_are_named_and_not_asked_for_are_refused(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    made = with_assets(namespace)
    made["spec"]["vast"]["execution"]["kubernetes"] = {"gpu_resource": "amd.com/gpu"}
    fake_cluster.apply(made)
    told = rejection(fake_cluster, namespace, "InvalidDocument", operator)
    assert "execution.kubernetes.gpu_resource, but no container requests `gpu`" in told


def test_pods_ask_for_devices_by_the_templates_of_their_namespace(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """No driver is here that could give them: the pods wait."""
    made = with_assets(namespace)
    made["spec"]["vast"]["execution"]["kubernetes"] = {"device_claims": ["camera"]}
    fake_cluster.apply(made)
    told = rejection(fake_cluster, namespace, "DevicesNotFound", operator)
    assert "no ResourceClaimTemplate `camera`" in told
    request = {"name": "one", "exactly": {"deviceClassName": "cameras"}}
    fake_cluster.apply(
        {
            "apiVersion": "resource.k8s.io/v1",
            "kind": "ResourceClaimTemplate",
            "metadata": {"name": "camera", "namespace": namespace},
            "spec": {"spec": {"devices": {"requests": [request]}}},
        }
    )

    def pods() -> Any:
        selector = "--selector=robovast.io/role=shard"
        return fake_cluster.get("pods", f"--namespace={namespace}", selector)["items"]

    spec = eventually(pods, told=operator.told)[0]["spec"]
    wanted = [{"name": "device-0", "resourceClaimTemplateName": "camera"}]
    assert spec["resourceClaims"] == wanted
    having = {
        container["name"]
        for container in (*spec["initContainers"], *spec["containers"])
        if container["resources"].get("claims") == [{"name": "device-0"}]
    }
    assert having == {"robovast", "simulator"}
