"""Kueue, installed from its own chart."""

from . import containerd, gobuild, programs, scratch
from .helm import helm
from .kubernetes import Cluster

NAMESPACE = "kueue-system"
MEMORY = "2Gi"
"""Kueue watches all pods: with 10,000 that have ended, the 512Mi of its chart are not enough."""


def install(cluster: Cluster) -> None:
    """Install Kueue on a cluster with a node and wait until it admits workloads.

    :raises StartFailed: when it is not ready within 3 min.
    """
    image = scratch.archive(gobuild.build(programs.KUEUE), executable="manager")
    containerd.of(cluster.bed).load(image)
    repository, _, tag = scratch.image("kueue").rpartition(":")
    manager = "controllerManager.manager"
    settings = {
        f"{manager}.image.repository": repository,
        f"{manager}.image.tag": tag,
        f"{manager}.image.pullPolicy": "Never",
        f"{manager}.resources.requests.cpu": "50m",
        f"{manager}.resources.limits.memory": MEMORY,
        "controllerManager.readinessProbe.initialDelaySeconds": "1",
        "controllerManager.readinessProbe.periodSeconds": "1",
    }
    chart = gobuild.source(programs.KUEUE.module, programs.KUEUE.version) / "charts" / "kueue"
    helm(
        *(cluster, "install", "kueue", str(chart), f"--namespace={NAMESPACE}"),
        *("--create-namespace", "--wait", "--timeout=3m"),
        *(f"--set={key}={value}" for key, value in settings.items()),
    )
