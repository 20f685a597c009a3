"""Metrics for Prometheus, not labelled by campaign or run: series would grow without end."""

from __future__ import annotations

import time
from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from robovast_operator.kube.lenient import mapping, number, text
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import Store
from robovast_operator.kube.work_queue import WorkQueue

MANY_FAILURES = 3
"""Consecutive failed reconciles of one campaign that count as a permanent failure."""


class Metrics:
    """The operator's metrics."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self.reconciles = Histogram(
            "robovast_reconcile_seconds",
            "Time of one look at a campaign.",
            buckets=(0.005, 0.02, 0.1, 0.5, 2, 10),
            registry=self._registry,
        )
        self._failures = Counter(
            "robovast_reconcile_failures",
            "Looks at a campaign that came to nothing, by what is told as the cause.",
            ["reason"],
            registry=self._registry,
        )
        self._failing = Gauge(
            "robovast_campaigns_failing",
            f"Campaigns at which {MANY_FAILURES} looks or more came to nothing, one after another.",
            registry=self._registry,
        )
        self._requests = Counter(
            "robovast_api_requests",
            "Requests to the Kubernetes API.",
            ["verb", "resource", "code"],
            registry=self._registry,
        )
        self._queue = Gauge(
            "robovast_queue_keys", "Campaigns that wait for a look.", registry=self._registry
        )
        self._objects = Gauge(
            "robovast_objects", "Objects that are known.", ["kind"], registry=self._registry
        )
        self._runs = Gauge(
            "robovast_runs", "Runs of all campaigns by state.", ["state"], registry=self._registry
        )
        self._campaigns = Gauge(
            "robovast_campaigns", "Campaigns by state.", ["state"], registry=self._registry
        )
        self._stalled = Gauge(
            "robovast_campaigns_stalled",
            "Campaigns that need somebody's help: condition Stalled.",
            registry=self._registry,
        )
        self._event_age = Gauge(
            "robovast_watch_event_age_seconds",
            "Time since the last event of any watch.",
            registry=self._registry,
        )
        self._leader = Gauge(
            "robovast_leader", "1 for the replica that works.", registry=self._registry
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

    def page(self, store: Store, queue: WorkQueue, *, leading: bool) -> bytes:
        """The metrics in Prometheus' text format."""
        self._queue.set(len(queue))
        self._failing.set(queue.failing(MANY_FAILURES))
        self._leader.set(int(leading))
        self._event_age.set(time.monotonic() - self._last_event)
        self._objects.labels("Campaign").set(len(store.campaigns))
        self._objects.labels("Configuration").set(len(store.configurations))
        self._objects.labels("Job").set(sum(len(jobs) for jobs in store.jobs.values()))
        for state in ("active", "waiting", "passed", "failed", "errored", "undecided"):
            self._runs.labels(state).set(_runs(store, state))
        self._campaigns.clear()
        for status in _statuses(store):
            self._campaigns.labels(text(status.get("state")) or "Pending").inc()
        self._stalled.set(sum(_is_stalled(status) for status in _statuses(store)))
        return generate_latest(self._registry)


def _collection(parts: list[str]) -> int:
    return 3 if parts[:1] == ["apis"] else 2


def _statuses(store: Store) -> Iterator[Object]:
    return (obj["status"] for obj in store.campaigns.values())


def _runs(store: Store, state: str) -> int:
    return sum(number(mapping(status.get("runs")).get(state)) for status in _statuses(store))


def _is_stalled(status: Object) -> bool:
    conditions = status.get("conditions") or ()
    return any(c["type"] == "Stalled" and c["status"] == "True" for c in conditions)
