"""Paths of the Kubernetes API."""

from __future__ import annotations

from robovast.kubeapi.resources import GROUP, VERSION


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


def resource_quotas(namespace: str) -> str:
    """ResourceQuotas of a namespace."""
    return f"/api/v1{_in(namespace)}/resourcequotas"


def limit_ranges(namespace: str) -> str:
    """LimitRanges of a namespace."""
    return f"/api/v1{_in(namespace)}/limitranges"


def volume_claims(namespace: str) -> str:
    """PersistentVolumeClaims of a namespace."""
    return f"/api/v1{_in(namespace)}/persistentvolumeclaims"


DEVICES = "resource.k8s.io"


def claim_template(version: str, namespace: str, name: str) -> str:
    """A ResourceClaimTemplate of a namespace."""
    return f"/apis/{DEVICES}/{version}{_in(namespace)}/resourceclaimtemplates/{name}"


def events(namespace: str) -> str:
    """Events of a namespace."""
    return f"/api/v1{_in(namespace)}/events"


KUEUE = "kueue.x-k8s.io"
KUEUE_VISIBILITY = "visibility.kueue.x-k8s.io"


def group(name: str) -> str:
    """An API group, whose answer lists the served versions."""
    return f"/apis/{name}"


def workloads(version: str, namespace: str) -> str:
    """Kueue's Workloads of a namespace."""
    return f"/apis/{KUEUE}/{version}{_in(namespace)}/workloads"


def local_queue(version: str, namespace: str, name: str) -> str:
    """A LocalQueue of Kueue."""
    return f"/apis/{KUEUE}/{version}{_in(namespace)}/localqueues/{name}"


def priority_class(version: str, name: str) -> str:
    """A WorkloadPriorityClass of Kueue."""
    return f"/apis/{KUEUE}/{version}/workloadpriorityclasses/{name}"


def worker_cluster(version: str, name: str) -> str:
    """A worker cluster as MultiKueue knows it."""
    return f"/apis/{KUEUE}/{version}/multikueueclusters/{name}"


def pending_workloads(version: str, namespace: str, queue: str) -> str:
    """The pending workloads of a LocalQueue, in order, from Kueue's visibility server."""
    queues = f"/apis/{KUEUE_VISIBILITY}/{version}{_in(namespace)}/localqueues"
    return f"{queues}/{queue}/pendingworkloads"


def leases(namespace: str | None = None) -> str:
    """Leases of a namespace, or of all."""
    return f"/apis/coordination.k8s.io/v1{_in(namespace)}/leases"


ACCESS_REVIEWS = "/apis/authorization.k8s.io/v1/subjectaccessreviews"
"""Answers whether an account may do something."""


def _in(namespace: str | None) -> str:
    return f"/namespaces/{namespace}" if namespace else ""
