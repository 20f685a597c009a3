"""Metrics for Prometheus.

None is labelled by campaign or run: series would grow without end. Those by namespace are of
namespaces that have Campaigns.
"""

from __future__ import annotations

import time
from collections import Counter as Counts
from collections.abc import Iterable, Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import Store
from robovast_operator.kube.untrusted_fields import mapping, number, text
from robovast_operator.kube.work_queue import WorkQueue

RUN_STATES = ("active", "waiting", "passed", "failed", "errored", "undecided", "notNeeded")

NAMESPACE = "campaign_namespace"
"""Label; Prometheus itself sets `namespace`, to that of the operator."""

MANY_FAILURES = 3
"""Consecutive failed reconciles of one campaign that count as a permanent failure."""


class Metrics:
    """The operator's metrics."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self.reconciles = Histogram(
            "robovast_reconcile_seconds",
            "Duration of one reconcile of a campaign.",
            buckets=(0.005, 0.02, 0.1, 0.5, 2, 10),
            registry=self._registry,
        )
        self._failures = Counter(
            "robovast_reconcile_failures",
            "Failed reconciles of campaigns, by the reported reason.",
            ["reason"],
            registry=self._registry,
        )
        self._failing = Gauge(
            "robovast_campaigns_failing",
            f"Campaigns whose last {MANY_FAILURES} reconciles or more failed.",
            registry=self._registry,
        )
        self._requests = Counter(
            "robovast_api_requests",
            "Requests to the Kubernetes API.",
            ["verb", "resource", "code"],
            registry=self._registry,
        )
        self._queue = Gauge(
            "robovast_queue_keys", "Campaigns that wait for the operator.", registry=self._registry
        )
        self._objects = Gauge(
            "robovast_objects",
            "Objects in the operator's memory.",
            ["kind"],
            registry=self._registry,
        )
        self._runs = Gauge(
            "robovast_runs", "Runs of all campaigns by state.", ["state"], registry=self._registry
        )
        self._campaigns = Gauge(
            "robovast_campaigns", "Campaigns by state.", ["state"], registry=self._registry
        )
        self._namespace_runs = Gauge(
            "robovast_namespace_runs",
            "Runs of a namespace's campaigns by state.",
            [NAMESPACE, "state"],
            registry=self._registry,
        )
        self._namespace_campaigns = Gauge(
            "robovast_namespace_campaigns",
            "Campaigns of a namespace by state.",
            [NAMESPACE, "state"],
            registry=self._registry,
        )
        self._stalled = Gauge(
            "robovast_campaigns_stalled",
            "Stalled campaigns (condition Stalled).",
            registry=self._registry,
        )
        self._event_age = Gauge(
            "robovast_watch_event_age_seconds",
            "Time since the last event of any watch.",
            registry=self._registry,
        )
        self._leader = Gauge("robovast_leader", "1 for the leader.", registry=self._registry)
        self._blocked = Gauge(
            "robovast_operator_blocked",
            "1 if another installation works in the same namespaces, or if it has no Lease.",
            registry=self._registry,
        )
        self.put_off = Counter(
            "robovast_status_writes_put_off",
            "Status writes of Campaigns that were put off because their status changes too often.",
            registry=self._registry,
        )
        self._last_event = time.monotonic()

    def request(self, verb: str, path: str, code: int) -> None:
        """Count a request."""
        parts = [p for p in path.split("/") if p]
        at = parts.index("namespaces") + 2 if "namespaces" in parts else _collection(parts)
        resource = parts[at] if at < len(parts) else "other"
        self._requests.labels(verb, resource, str(code)).inc()

    def failed(self, reason: str) -> None:
        """Count a failed reconcile."""
        self._failures.labels(reason).inc()

    def seen(self) -> None:
        """Record that a watch event arrived."""
        self._last_event = time.monotonic()

    def page(
        self, store: Store, queue: WorkQueue, *, leading: bool, blocked: bool = False
    ) -> bytes:
        """Return the metrics in Prometheus' text format."""
        self._queue.set(len(queue))
        self._failing.set(queue.failing(MANY_FAILURES))
        self._leader.set(int(leading))
        self._blocked.set(int(blocked))
        self._event_age.set(time.monotonic() - self._last_event)
        self._objects.labels("Campaign").set(len(store.campaigns))
        self._objects.labels("Configuration").set(len(store.configurations))
        self._objects.labels("Job").set(sum(len(jobs) for jobs in store.jobs.values()))
        for state in RUN_STATES:
            self._runs.labels(state).set(_runs(_statuses(store), state))
        self._campaigns.clear()
        for state, campaigns in _states(_statuses(store)).items():
            self._campaigns.labels(state).set(campaigns)
        self._count_by_namespace(store)
        self._stalled.set(sum(_is_stalled(status) for status in _statuses(store)))
        return generate_latest(self._registry)

    def _count_by_namespace(self, store: Store) -> None:
        self._namespace_runs.clear()
        self._namespace_campaigns.clear()
        namespaces: dict[str, list[Object]] = {}
        for (namespace, _), obj in store.campaigns.items():
            namespaces.setdefault(namespace, []).append(obj["status"])
        for namespace, statuses in namespaces.items():
            for state in RUN_STATES:
                self._namespace_runs.labels(namespace, state).set(_runs(statuses, state))
            for state, campaigns in _states(statuses).items():
                self._namespace_campaigns.labels(namespace, state).set(campaigns)


def _collection(parts: list[str]) -> int:
    return 3 if parts[:1] == ["apis"] else 2


def _statuses(store: Store) -> Iterator[Object]:
    return (obj["status"] for obj in store.campaigns.values())


def _runs(statuses: Iterable[Object], state: str) -> int:
    return sum(number(mapping(status.get("runs")).get(state)) for status in statuses)


def _states(statuses: Iterable[Object]) -> Counts[str]:
    return Counts(text(status.get("state")) or "Pending" for status in statuses)


def _is_stalled(status: Object) -> bool:
    conditions = status.get("conditions") or ()
    return any(c["type"] == "Stalled" and c["status"] == "True" for c in conditions)
