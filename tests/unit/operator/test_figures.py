"""The figures that an admin watches."""

from __future__ import annotations

from typing import Any

from robovast_operator.kube.metrics import Metrics
from robovast_operator.kube.store import Store
from robovast_operator.kube.work_queue import WorkQueue


def figures(*statuses: dict[str, Any]) -> str:
    store = Store()
    for number, status in enumerate(statuses):
        meta = {"namespace": "lab", "name": f"drive-{number}", "resourceVersion": "1"}
        store.put_campaign({"metadata": {**meta, "uid": str(number)}, "status": status})
    return Metrics().page(store, WorkQueue(), leading=True).decode()


def test_campaigns_are_counted_by_state_and_those_that_need_help() -> None:
    stalled = {"type": "Stalled", "status": "True"}
    fine = {"type": "Stalled", "status": "False"}
    text = figures(
        {"state": "Running", "conditions": [stalled]},
        {"state": "Running", "conditions": [fine], "runs": {"passed": 3}},
        {"state": "Finished", "runs": {"passed": 4}},
        {},
    )
    for line in (
        'robovast_campaigns{state="Running"} 2.0',
        'robovast_campaigns{state="Finished"} 1.0',
        'robovast_campaigns{state="Pending"} 1.0',
        "robovast_campaigns_stalled 1.0",
        'robovast_runs{state="passed"} 7.0',
    ):
        assert line in text.splitlines()


def test_runs_are_counted_for_each_namespace_that_has_campaigns() -> None:
    store, metrics = Store(), Metrics()
    for namespace, uid in (("a", "1"), ("b", "2")):
        meta = {"namespace": namespace, "name": "drive", "resourceVersion": "1", "uid": uid}
        status = {"state": "Running", "runs": {"active": int(uid), "waiting": 5}}
        store.put_campaign({"metadata": meta, "status": status})
    lines = metrics.page(store, WorkQueue(), leading=True).decode().splitlines()
    for line in (
        'robovast_namespace_runs{campaign_namespace="a",state="active"} 1.0',
        'robovast_namespace_runs{campaign_namespace="b",state="active"} 2.0',
        'robovast_namespace_runs{campaign_namespace="b",state="waiting"} 5.0',
        'robovast_namespace_campaigns{campaign_namespace="a",state="Running"} 1.0',
    ):
        assert line in lines
    store.drop_campaign(("b", "drive", "2"))
    assert 'campaign_namespace="b"' not in metrics.page(store, WorkQueue(), leading=True).decode()


def test_looks_that_come_to_nothing_are_counted_and_campaigns_that_go_on_failing() -> None:
    metrics, queue = Metrics(), WorkQueue()
    for _ in range(3):
        metrics.failed("QuotaExceeded")
        queue.add_failed(("lab", "drive"))
    queue.add_failed(("lab", "other"))
    lines = metrics.page(Store(), queue, leading=True).decode().splitlines()
    assert 'robovast_reconcile_failures_total{reason="QuotaExceeded"} 3.0' in lines
    assert "robovast_campaigns_failing 1.0" in lines
