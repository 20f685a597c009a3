"""`vast exec cluster setup` and `cleanup`: Helm, the chart and a real API server."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed import gobuild, programs
from robovast_testbed.kubernetes import Cluster

from robovast.base.errors import CannotRunError, InputError
from robovast_cli.commands.exec.cluster import setup as cluster_setup

ENDPOINT = "https://s3.example.org"
IDLE = ["operator.replicas=0", f"s3_endpoint={ENDPOINT}"]
"""No pods: nothing here could run them."""


@pytest.fixture
def namespace(
    control_plane: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    programs_folder = tmp_path / "bin"
    programs_folder.mkdir()
    (programs_folder / "helm").symlink_to(gobuild.build(programs.HELM))
    monkeypatch.setenv("PATH", f"{programs_folder}{os.pathsep}{os.environ['PATH']}")
    for name in ("HELM_CACHE_HOME", "HELM_CONFIG_HOME", "HELM_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setenv("KUBECONFIG", str(control_plane.kubeconfig))
    monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", "someone")
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", "hidden")
    yield "set-up"
    control_plane.kubectl("delete", "namespace", "set-up", "--wait=false", "--ignore-not-found")


def values(cluster: Cluster, namespace: str) -> dict[str, Any]:
    found: Any = cluster.get("secret", "robovast-storage", f"--namespace={namespace}")
    return {key: base64.b64decode(value).decode() for key, value in found["data"].items()}


def test_setup_installs_the_chart_and_cleanup_removes_it(
    control_plane: Cluster, namespace: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        cluster_setup.setup("generic", option=IDLE, namespace=namespace)
    assert "hidden" not in capsys.readouterr().out
    assert values(control_plane, namespace) == {
        "accessKey": "someone",
        "secretKey": "hidden",
        "endpoint": ENDPOINT,
    }
    deployments: Any = control_plane.get("deployments", f"--namespace={namespace}")["items"]
    assert [item["spec"]["replicas"] for item in deployments] == [0]
    with pytest.raises(CannotRunError, match=r"`generic`.*--force"):
        cluster_setup.setup("rke2", option=IDLE, namespace=namespace)

    campaign = {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Campaign",
        "metadata": {"name": "waiting", "namespace": namespace},
        "spec": {"vast": {"version": 1, "execution": {"scenario_file": "a.osc"}}},
    }
    control_plane.kubectl("create", "--filename=-", stdin=json.dumps(campaign))
    with pytest.raises(CannotRunError, match="waiting"):
        cluster_setup.cleanup(namespace=namespace)
    cluster_setup.cleanup(force=True, namespace=namespace)
    left: Any = control_plane.get("deployments", f"--namespace={namespace}")["items"]
    assert left == []
    assert control_plane.get("campaign", "waiting", f"--namespace={namespace}")
    with pytest.raises(CannotRunError, match="not installed"):
        cluster_setup.cleanup(namespace=namespace)


def test_a_server_of_ones_own_needs_credentials(
    namespace: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROBOVAST_S3_SECRET_KEY")
    with pytest.raises(InputError, match="ROBOVAST_S3_SECRET_KEY"):
        cluster_setup.setup("generic", option=IDLE, namespace=namespace)
