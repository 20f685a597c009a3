"""The testbed's control plane and its fake nodes."""

import json
import os
import subprocess

from robovast_testbed import bed, kwok
from robovast_testbed.kubernetes import Cluster, Manifest
from support.patience import eventually


def indexed_job(name: str, completions: int) -> Manifest:
    container = {"name": "run", "image": "none.invalid/never-pulled"}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"name": name, "namespace": "default"},
        "spec": {
            "completionMode": "Indexed",
            "completions": completions,
            "parallelism": completions,
            "template": {"spec": {"restartPolicy": "Never", "containers": [container]}},
        },
    }


def test_api_server_is_reached_from_outside_its_namespace(control_plane: Cluster) -> None:
    assert control_plane.kubectl("get", "--raw=/readyz") == "ok"


def test_api_server_is_not_bound_outside_the_loopback(control_plane: Cluster) -> None:
    config = json.loads(control_plane.kubeconfig.read_text())

    assert config["clusters"][0]["cluster"]["server"].startswith("https://127.0.0.1:")


def test_fake_nodes_run_a_hundred_pods(control_plane: Cluster) -> None:
    kwok.start(control_plane, 5)
    control_plane.apply(indexed_job("hundred", 100))

    control_plane.kubectl("wait", "job/hundred", "--for=condition=Complete", "--timeout=180s")

    status = control_plane.get("job/hundred")["status"]
    assert isinstance(status, dict)
    assert status["completedIndexes"] == "0-99"


def test_every_request_is_in_the_audit_log(control_plane: Cluster) -> None:
    control_plane.kubectl("get", "--raw=/api/v1/namespaces/audited/pods")

    def logged() -> bool:
        lines = control_plane.audit_log.read_text().split("\n")[:-1]  # the last may be half written
        entries = map(json.loads, lines)
        return any(
            entry["user"].get("username") == "admin" and "audited" in entry["requestURI"]
            for entry in entries
        )

    eventually(logged)


def test_machine_sees_nothing_of_the_namespace(control_plane: Cluster) -> None:
    links = subprocess.run(["ip", "-o", "link"], capture_output=True, text=True, check=True)

    assert control_plane.bed.name in bed.names()
    assert "tb0" not in links.stdout
    assert os.readlink("/proc/self/ns/net") != _namespace_inside(control_plane)


def _namespace_inside(cluster: Cluster) -> str:
    return cluster.bed.run("readlink", "/proc/self/ns/net").strip()
