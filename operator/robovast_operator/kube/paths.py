"""Paths of the Kubernetes API."""

from __future__ import annotations

from robovast.kubeapi.resources import GROUP, VERSION


def campaigns(namespace: str | None = None) -> str:
    """Return Campaigns of a namespace, or of all."""
    return f"/apis/{GROUP}/{VERSION}{_in(namespace)}/campaigns"


def configurations(namespace: str | None = None) -> str:
    """Return Configurations of a namespace, or of all."""
    return f"/apis/{GROUP}/{VERSION}{_in(namespace)}/configurations"


def jobs(namespace: str | None = None) -> str:
    """Return Jobs of a namespace, or of all."""
    return f"/apis/batch/v1{_in(namespace)}/jobs"


def pods(namespace: str) -> str:
    """Return Pods of a namespace."""
    return f"/api/v1{_in(namespace)}/pods"


def config_maps(namespace: str) -> str:
    """Return ConfigMaps of a namespace."""
    return f"/api/v1{_in(namespace)}/configmaps"


def resource_quotas(namespace: str) -> str:
    """Return ResourceQuotas of a namespace."""
    return f"/api/v1{_in(namespace)}/resourcequotas"


def limit_ranges(namespace: str) -> str:
    """Return LimitRanges of a namespace."""
    return f"/api/v1{_in(namespace)}/limitranges"


def volume_claims(namespace: str) -> str:
    """Return PersistentVolumeClaims of a namespace."""
    return f"/api/v1{_in(namespace)}/persistentvolumeclaims"


DEVICES = "resource.k8s.io"


def claim_template(version: str, namespace: str, name: str) -> str:
    """Return A ResourceClaimTemplate of a namespace."""
    return f"/apis/{DEVICES}/{version}{_in(namespace)}/resourceclaimtemplates/{name}"


def events(namespace: str) -> str:
    """Return Events of a namespace."""
    return f"/api/v1{_in(namespace)}/events"


KUEUE = "kueue.x-k8s.io"
KUEUE_VISIBILITY = "visibility.kueue.x-k8s.io"


def group(name: str) -> str:
    """Return an API group, whose answer lists the served versions."""
    return f"/apis/{name}"


def workloads(version: str, namespace: str) -> str:
    """Return Kueue's Workloads of a namespace."""
    return f"/apis/{KUEUE}/{version}{_in(namespace)}/workloads"


def local_queue(version: str, namespace: str, name: str) -> str:
    """Return A LocalQueue of Kueue."""
    return f"/apis/{KUEUE}/{version}{_in(namespace)}/localqueues/{name}"


def priority_class(version: str, name: str) -> str:
    """Return A WorkloadPriorityClass of Kueue."""
    return f"/apis/{KUEUE}/{version}/workloadpriorityclasses/{name}"


def worker_cluster(version: str, name: str) -> str:
    """Return the path of a MultiKueueCluster."""
    return f"/apis/{KUEUE}/{version}/multikueueclusters/{name}"


def pending_workloads(version: str, namespace: str, queue: str) -> str:
    """Return the pending workloads of a LocalQueue, in order, from Kueue's visibility server."""
    queues = f"/apis/{KUEUE_VISIBILITY}/{version}{_in(namespace)}/localqueues"
    return f"{queues}/{queue}/pendingworkloads"


def leases(namespace: str | None = None) -> str:
    """Return Leases of a namespace, or of all."""
    return f"/apis/coordination.k8s.io/v1{_in(namespace)}/leases"


ACCESS_REVIEWS = "/apis/authorization.k8s.io/v1/subjectaccessreviews"
"""Answers whether an account may do something."""


def _in(namespace: str | None) -> str:
    return f"/namespaces/{namespace}" if namespace else ""
