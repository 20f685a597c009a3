"""A Campaign that names a queue, where nobody looks after queues."""

from __future__ import annotations

import json
from pathlib import Path

from operator_process import OperatorProcess, campaign, condition, eventually, status
from robovast_testbed.kubernetes import Cluster


def test_a_campaign_without_kueue_says_so_and_runs_without_a_queue(
    fake_cluster: Cluster, namespace: str, tmp_path: Path
) -> None:
    operator = OperatorProcess(
        fake_cluster,
        tmp_path,
        ROBOVAST_LEASE_SECONDS="2",
        ROBOVAST_STALL_SECONDS="1",
        ROBOVAST_NAMESPACES=namespace,
    )
    operator.start()
    try:
        fake_cluster.apply(campaign("few", namespace, 3, 2, queueName="robovast"))

        def stalled() -> bool:
            found = condition(status(fake_cluster, namespace, "few"), "Stalled")
            return found.get("status") == "True"

        eventually(stalled, 60, operator.log.read_text)
        state = status(fake_cluster, namespace, "few")
        assert state["state"] == "Queued"
        assert condition(state, "Stalled")["reason"] == "NoKueue"
        assert "is Kueue installed" in condition(state, "QuotaReserved")["message"]
        patch = json.dumps({"spec": {"queueName": None}})
        fake_cluster.kubectl(
            *("--namespace", namespace, "patch", "campaign", "few", "--type=merge"),
            f"--patch={patch}",
        )
        eventually(
            lambda: status(fake_cluster, namespace, "few")["progress"] == "6/6",
            60,
            operator.log.read_text,
        )
    finally:
        operator.stop()
    assert "a fault of the operator" not in operator.log.read_text()
