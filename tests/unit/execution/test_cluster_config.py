"""Cluster configurations: values of the chart, and those that others wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast.base.plugins import load_plugin, plugins_of
from robovast.execution.cluster_config import base_config
from robovast.execution.cluster_config.base import BaseConfig
from robovast.kubeapi.cluster_config.builtin import AzureConfig, GcpConfig, GenericConfig
from robovast.kubeapi.cluster_config.capacity import capacity_beside
from robovast_cli.commands.exec.cluster import chart
from robovast_cli.commands.exec.cluster import setup as cluster_setup


def values(kind: type[BaseConfig], **options: str) -> dict[str, Any]:
    config = kind()
    config.restore_from_setup_kwargs(options)
    return config.chart_values()


def test_all_kinds_are_there_and_each_makes_values() -> None:
    names = plugins_of("robovast.cluster_configs")
    assert set(names) >= {"minikube", "rke2", "gcp", "azure", "generic"}
    for name in names:
        kind = load_plugin(name, "robovast.cluster_configs", ".")
        assert values(kind)["storage"]["embedded"]["enabled"] is True


def test_disks_are_chosen_by_their_types_storage_class() -> None:
    def storage_class(kind: type[BaseConfig], **options: str) -> str:
        return str(values(kind, **options)["storage"]["embedded"]["storageClassName"])

    assert storage_class(GcpConfig) == "standard"
    assert storage_class(GcpConfig, disk_type="pd-ssd") == "premium-rwo"
    assert storage_class(AzureConfig, disk_type="premium") == "managed-csi-premium"
    assert storage_class(GcpConfig, storage_class="fast") == "fast"
    with pytest.raises(InputError, match="pd-balanced"):
        storage_class(GcpConfig, disk_type="floppy")


def test_a_server_of_ones_own_takes_the_place_of_the_embedded_one() -> None:
    made = values(GenericConfig, s3_endpoint="https://s3.example.org", s3_secret="keys")
    assert made == {
        "storage": {
            "embedded": {"enabled": False},
            "external": {"endpoint": "https://s3.example.org"},
            "credentials": {"existingSecret": "keys"},
        }
    }


def test_an_unknown_option_is_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"storage_sice.*storage_size"):
        values(GenericConfig, storage_sice="1Gi")


def test_a_configuration_that_others_wrote_needs_no_more_than_it_overrides(tmp_path: Path) -> None:
    class Theirs(base_config.BaseConfig):
        def __init__(self) -> None:
            self.prepared: list[str] = []

        def setup_cluster(self, **kwargs: Any) -> None:
            self.prepared.append(kwargs["namespace"])

        def uses_embedded_s3(self) -> bool:
            return False

        def get_s3_endpoint(self) -> str:
            return "http://minio.lab:9000"

        def get_s3_credentials(self) -> tuple[str, str]:
            return "a", "b"

    made = values(Theirs, anything="goes")
    assert made["storage"]["external"] == {"endpoint": "http://minio.lab:9000"}
    assert Theirs().verify_cluster_ready(k8s_client=None) is None


def node(name: str, cpu: str, memory: str, **spec: Any) -> dict[str, Any]:
    allocatable = {"cpu": cpu, "memory": memory}
    return {"metadata": {"name": name}, "spec": spec, "status": {"allocatable": allocatable}}


def pod(node_name: str | None, *requests: dict[str, str]) -> dict[str, Any]:
    containers = [{"resources": {"requests": request}} for request in requests]
    return {"spec": {"nodeName": node_name, "containers": [*containers, {}]}}


def test_campaigns_may_use_what_others_leave() -> None:
    taint = [{"key": "node-role.kubernetes.io/control-plane", "effect": "NoSchedule"}]
    nodes = [node("a", "4", "8Gi"), node("b", "3920m", "4Gi"), node("c", "8", "8Gi", taints=taint)]
    pods = [
        pod("a", {"cpu": "250m", "memory": "1Gi"}, {"cpu": "0"}),
        pod("c", {"cpu": "1"}),
        pod(None, {"cpu": "1"}),
    ]
    assert capacity_beside(nodes, pods) == (7.67, 11 * 2**30)


def test_prepared_files_hold_no_credentials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", "someone")
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", "hidden")
    options = ["s3_endpoint=https://s3.example.org", "operator.replicas=2"]
    out = tmp_path / "out"
    for _ in range(2):
        cluster_setup.prepare_setup(out, "generic", options, "lab")
    texts = {p.relative_to(out): p.read_text() for p in out.rglob("*") if p.is_file()}
    assert not any("hidden" in text for text in texts.values())
    assert "replicas: 2" in texts[Path("values.yaml")]
    assert "helm upgrade robovast ./robovast" in texts[Path("README.md")]
    assert Path("robovast/Chart.yaml") in texts
    assert (
        chart.chart_folder().joinpath("Chart.yaml").read_text()
        == texts[Path("robovast/Chart.yaml")]
    )
