"""Campaigns that are let in by nobody: what is said of them, and that they go on."""

from __future__ import annotations

import json

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    status,
)
from support.patience import eventually


@pytest.fixture
def operator(new_operator: NewOperator) -> OperatorProcess:
    """An operator that soon finds that nothing moves."""
    made = new_operator(ROBOVAST_STALL_SECONDS="1")
    made.start()
    return made


def wait_stalled(cluster: Cluster, namespace: str, operator: OperatorProcess) -> dict[str, str]:
    """The condition Stalled of the campaign `few`, as soon as it holds."""

    def stalled() -> dict[str, str] | None:
        found = condition(status(cluster, namespace, "few"), "Stalled")
        return found if found.get("status") == "True" else None

    told: dict[str, str] = eventually(stalled, told=operator.told)
    return told


def wait_done(cluster: Cluster, namespace: str, operator: OperatorProcess) -> None:
    eventually(
        lambda: status(cluster, namespace, "few").get("progress") == "6/6",
        60,
        operator.told,
    )


def test_a_campaign_without_kueue_says_so_and_runs_without_a_queue(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    fake_cluster.apply(campaign("few", namespace, 3, 2, queueName="robovast"))
    assert wait_stalled(fake_cluster, namespace, operator)["reason"] == "NoKueue"
    state = status(fake_cluster, namespace, "few")
    assert state["state"] == "Queued"
    assert "Check that Kueue is installed" in condition(state, "QuotaReserved")["message"]
    patch = json.dumps({"spec": {"queueName": None}})
    fake_cluster.kubectl(
        *("--namespace", namespace, "patch", "campaign", "few", "--type=merge"),
        f"--patch={patch}",
    )
    wait_done(fake_cluster, namespace, operator)


def test_what_the_api_server_refuses_is_told_and_tried_again(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """As where the webhook of a queue is away; here the namespace may have no Jobs."""
    fake_cluster.apply(
        {
            "apiVersion": "v1",
            "kind": "ResourceQuota",
            "metadata": {"name": "none", "namespace": namespace},
            "spec": {"hard": {"count/jobs.batch": "0"}},
        }
    )
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    told = wait_stalled(fake_cluster, namespace, operator)
    assert told["reason"] == "QuotaExceeded"
    assert "exceeded quota: none" in told["message"]
    fake_cluster.kubectl("--namespace", namespace, "delete", "resourcequota", "none")
    wait_done(fake_cluster, namespace, operator)
    stalled = condition(status(fake_cluster, namespace, "few"), "Stalled")
    assert stalled["status"] == "False"
