"""The operator on the oldest Kubernetes that the chart promises; all other tests use the newest."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from robovast_testbed import programs
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    OperatorProcess,
    campaign,
    condition,
    finish_stage,
    prepare,
    status,
)
from support.patience import eventually

CHART = Path(__file__).parents[2] / "helm/robovast/Chart.yaml"


@pytest.fixture(scope="module")
def oldest_cluster(oldest_control_plane: Cluster) -> Cluster:
    """Fake nodes under a control plane of that version."""
    prepare(oldest_control_plane, 2, [finish_stage("few", 6)])
    return oldest_control_plane


def test_the_oldest_version_is_the_one_that_the_chart_states() -> None:
    stated = yaml.safe_load(CHART.read_text())["kubeVersion"]
    minor = programs.OLDEST_KUBERNETES.rpartition(".")[0]
    assert stated == f">={minor}.0-0"


def accepted(cluster: Cluster, name: str) -> str:
    """What the condition Accepted of a campaign says in a word."""
    return condition(status(cluster, "lab", name), "Accepted").get("reason", "")


def test_a_campaign_on_the_oldest_version_comes_to_its_end_or_says_what_that_lacks(
    oldest_cluster: Cluster, tmp_path: Path
) -> None:
    version = oldest_cluster.kubectl("get", "--raw=/version")
    assert programs.OLDEST_KUBERNETES in version
    oldest_cluster.kubectl("create", "namespace", "lab")
    operator = OperatorProcess(oldest_cluster, tmp_path, ROBOVAST_LEASE_SECONDS="2")
    operator.start()
    try:
        oldest_cluster.apply(campaign("few", "lab", 3, 2))

        def passed() -> bool:
            found = condition(status(oldest_cluster, "lab", "few"), "Passed")
            return found.get("status") == "True"

        eventually(passed, told=operator.told)
        state = status(oldest_cluster, "lab", "few")
        assert (state["progress"], state["state"]) == ("6/6", "Finished")
        oldest_cluster.kubectl("--namespace=lab", "delete", "campaign", "few", "--timeout=20s")
        lacking = {
            "AssetsNotSupported": {"assets": [{"path": "/assets", "image": "models:1"}]},
            "DevicesNotSupported": {"device_claims": ["camera"]},
        }
        for number, (reason, wanted) in enumerate(lacking.items()):
            modern = campaign(f"modern-{number}", "lab", 3, 2)
            modern["spec"]["vast"]["execution"]["kubernetes"] = wanted
            oldest_cluster.apply(modern)
            eventually(
                lambda name=f"modern-{number}": accepted(oldest_cluster, name) == reason,  # noqa: B023
                30,
                operator.told,
            )
        assert operator.alive
        assert "Traceback" not in operator.told(), operator.told()
    finally:
        operator.stop()
