"""What the API server refuses before there is any Job: the Campaign says so."""

from __future__ import annotations

import json

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    campaign,
    condition,
    created,
    finished,
    free_port,
    page,
)
from support.kube.operator_process import status as status_of
from support.patience import eventually


@pytest.mark.parametrize("kind", ["configmaps", "jobs.batch"])
def test_a_quota_is_told_and_once_it_is_raised_the_campaign_goes_on(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator, kind: str
) -> None:
    quota = {
        "apiVersion": "v1",
        "kind": "ResourceQuota",
        "metadata": {"name": "small", "namespace": namespace},
        "spec": {"hard": {f"count/{kind}": "0"}},
    }
    fake_cluster.apply(quota)
    port = free_port()
    operator = new_operator(ROBOVAST_STALL_SECONDS="2", ROBOVAST_PORT=str(port))
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))

    def told() -> bool:
        state = status_of(fake_cluster, namespace, "few")
        return condition(state, "Stalled").get("reason") == "QuotaExceeded"

    eventually(told, told=operator.told)
    message = condition(status_of(fake_cluster, namespace, "few"), "Stalled")["message"]
    assert "exceeded quota: small" in message
    assert 'robovast_reconcile_failures_total{reason="QuotaExceeded"}' in page(port, "metrics")
    assert "robovast_campaigns_failing 1.0" in page(port, "metrics")
    fake_cluster.kubectl("delete", "resourcequota", "small", f"--namespace={namespace}")
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)


def test_objects_that_only_show_entries_hold_no_run_back(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    fake_cluster.apply(
        {
            "apiVersion": "v1",
            "kind": "ResourceQuota",
            "metadata": {"name": "small", "namespace": namespace},
            "spec": {"hard": {"count/configurations.robovast.io": "0"}},
        }
    )
    operator = new_operator(ROBOVAST_STALL_SECONDS="2")
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    state = status_of(fake_cluster, namespace, "few")
    assert condition(state, "Stalled")["status"] == "False"
    events = json.loads(
        fake_cluster.kubectl("get", "events", f"--namespace={namespace}", "--output=json")
    )["items"]
    told = [item for item in events if item["reason"] == "QuotaExceeded"]
    assert len(told) == 1
    assert "quota: small" in told[0]["message"]


def test_a_document_that_no_object_can_hold_is_told(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    operator = new_operator(ROBOVAST_STALL_SECONDS="2")
    operator.start()
    obj = campaign("few", namespace, 3, 2)
    obj["spec"]["vast"]["metadata"] = {"notes": "0123456789abcdef" * 68_000}
    fake_cluster.kubectl("create", "-f", "-", stdin=json.dumps(obj))

    def told() -> bool:
        state = status_of(fake_cluster, namespace, "few")
        return condition(state, "Stalled").get("reason") == "ObjectTooLarge"

    eventually(told, told=operator.told)
    assert not created(fake_cluster, namespace, "jobs")
