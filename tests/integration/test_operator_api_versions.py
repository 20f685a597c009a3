"""Campaigns and Configurations of either version of the API under the operator; fake nodes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.definitions import NEWER, OLDER, VERSIONS, as_version, read
from support.kube.operator_process import NewOperator, campaign, condition, finished, status
from support.patience import eventually

VAST = Path(sys.executable).with_name("vast")


@pytest.mark.parametrize("version", VERSIONS)
def test_a_campaign_of_either_version_runs_to_its_end(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator, version: str
) -> None:
    """As everybody sees it: `kubectl wait`, columns, fields by which to choose, Events, owners."""
    fake_cluster.apply(as_version(campaign("few", namespace, 3, 2), version))
    operator = new_operator()
    operator.start()
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    for shown in VERSIONS:
        kind = f"campaigns.{shown}.robovast.io"

        def kubectl(*arguments: str) -> str:
            return fake_cluster.kubectl(*arguments, f"--namespace={namespace}")

        kubectl("wait", f"{kind}/few", "--for=condition=Passed", "--timeout=20s")
        (line,) = kubectl("get", kind, "--no-headers").splitlines()
        assert line.split()[:3] == ["few", "Finished", "6/6"]
        chosen = kubectl("get", kind, "--field-selector=status.state=Finished", "--output=name")
        assert chosen.strip().endswith("/few")
        assert "Planned" in kubectl("describe", kind, "few")
    uid = read(fake_cluster, NEWER, namespace, "few")["metadata"]["uid"]
    own = {"apiVersion": f"robovast.io/{OLDER}", "kind": "Campaign", "name": "few", "uid": uid}
    for made in ("jobs", "configmaps", "configurations"):
        items: Any = fake_cluster.get(made, f"--namespace={namespace}")["items"]
        owners = [o for i in items for o in i["metadata"].get("ownerReferences", [])]
        assert owners
        assert all(own.items() <= owner.items() for owner in owners), "a chart before serves it"
    fake_cluster.kubectl(
        *("delete", f"campaigns.{version}.robovast.io/few", f"--namespace={namespace}"),
        "--timeout=60s",
    )
    jobs = ("jobs", f"--namespace={namespace}")
    eventually(lambda: not fake_cluster.get(*jobs)["items"])


@pytest.mark.parametrize(("of_campaign", "of_addition"), [(OLDER, NEWER), (NEWER, OLDER)])
def test_a_configuration_of_one_version_adds_runs_to_a_campaign_of_the_other(
    fake_cluster: Cluster,
    namespace: str,
    new_operator: NewOperator,
    of_campaign: str,
    of_addition: str,
) -> None:
    operator = new_operator()
    operator.start()
    made = campaign("few", namespace, 2, 2)  # with the two that are added six, as is told
    addition = {
        "kind": "Configuration",
        "metadata": {"name": "extra", "namespace": namespace},
        "spec": {"campaign": "few", "parameters": [{"x": 7}], "runs": 2},
    }
    fake_cluster.apply(as_version(made, of_campaign), as_version(addition, of_addition))

    def over() -> bool:
        state = status(fake_cluster, namespace, "few")
        return state.get("finishedShards") == 2 and state["state"] == "Finished"

    eventually(over, told=operator.told)

    def told() -> Any:
        found: Any = fake_cluster.get("configuration", "extra", f"--namespace={namespace}")
        return found.get("status") or {}

    eventually(lambda: told().get("progress") == "2/2", 30, told)
    assert condition(told(), "Accepted")["status"] == "True"


def test_vast_works_on_a_campaign_of_the_newer_version(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    operator = new_operator()
    operator.start()
    fake_cluster.apply(as_version(campaign("few", namespace, 3, 2, suspend=True), NEWER))
    eventually(
        lambda: status(fake_cluster, namespace, "few").get("state") == "Suspended",
        30,
        operator.told,
    )

    def vast(*arguments: str) -> str:
        return subprocess.run(
            [VAST, "exec", "cluster", *arguments, "--namespace", namespace],
            env={**os.environ, **fake_cluster.env, "COLUMNS": "200"},
            capture_output=True, text=True, timeout=120, check=True,
        ).stdout  # fmt: skip

    assert "few" in vast("monitor", "--once")
    vast("resume", "-i", "few")
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert "6/6" in vast("monitor", "--once")
    vast("run-cleanup", "-i", "few")
    left = ("get", "campaigns", f"--namespace={namespace}", "--output=name")
    eventually(lambda: not fake_cluster.kubectl(*left), 30)
