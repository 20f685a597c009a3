"""Paths of the Kubernetes API."""

from __future__ import annotations

from robovast.cluster.resources import GROUP, VERSION


def campaigns(namespace: str | None = None) -> str:
    """Campaigns of a namespace, or of all."""
    return f"/apis/{GROUP}/{VERSION}{_in(namespace)}/campaigns"


def configurations(namespace: str | None = None) -> str:
    """Configurations of a namespace, or of all."""
    return f"/apis/{GROUP}/{VERSION}{_in(namespace)}/configurations"


def jobs(namespace: str | None = None) -> str:
    """Jobs of a namespace, or of all."""
    return f"/apis/batch/v1{_in(namespace)}/jobs"


def pods(namespace: str) -> str:
    """Pods of a namespace."""
    return f"/api/v1{_in(namespace)}/pods"


def config_maps(namespace: str) -> str:
    """ConfigMaps of a namespace."""
    return f"/api/v1{_in(namespace)}/configmaps"


def events(namespace: str) -> str:
    """Events of a namespace."""
    return f"/api/v1{_in(namespace)}/events"


def workloads(namespace: str) -> str:
    """Kueue's Workloads of a namespace."""
    return f"/apis/kueue.x-k8s.io/v1beta1{_in(namespace)}/workloads"


def local_queue(namespace: str, name: str) -> str:
    """A LocalQueue of Kueue."""
    return f"/apis/kueue.x-k8s.io/v1beta1{_in(namespace)}/localqueues/{name}"


def pending_workloads(namespace: str, queue: str) -> str:
    """What waits in a LocalQueue, in order, as Kueue's visibility server answers."""
    version = "/apis/visibility.kueue.x-k8s.io/v1beta1"
    return f"{version}{_in(namespace)}/localqueues/{queue}/pendingworkloads"


def leases(namespace: str) -> str:
    """Leases of a namespace."""
    return f"/apis/coordination.k8s.io/v1{_in(namespace)}/leases"


def _in(namespace: str | None) -> str:
    return f"/namespaces/{namespace}" if namespace else ""
