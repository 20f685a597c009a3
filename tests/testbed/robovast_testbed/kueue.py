"""Kueue, installed from its own chart: in a pod, or as a process beside a control plane."""

import base64
import json
from pathlib import Path

from . import containerd, gobuild, programs, scratch
from .commands import wait_for
from .errors import StartFailed
from .helm import helm
from .kubernetes import Cluster, Manifest

NAMESPACE = "kueue-system"
MEMORY = "2Gi"
"""Kueue watches all pods: with 10,000 that have ended, the 512Mi of its chart are not enough."""
HTTP2 = {"HTTP2_READ_IDLE_TIMEOUT_SECONDS": "2", "HTTP2_PING_TIMEOUT_SECONDS": "2"}
"""How soon a process notices that another cluster is silent; the default is 30 s and 15 s."""


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
    sets = (f"--set={key}={value}" for key, value in settings.items())
    _install_chart(cluster, "--wait", "--timeout=3m", *sets)


def start(cluster: Cluster, multikueue: Manifest) -> None:
    """Start Kueue beside a control plane, as a process, and wait until it looks after Jobs.

    It has no visibility server, whose files would be the machine's.

    :param multikueue: the section `multiKueue` of its configuration.
    :raises StartFailed: when it does not answer in time.
    """
    folder = cluster.bed.folder / "kueue"
    certificates, config = folder / "certificates", folder / "config.json"
    certificates.mkdir(parents=True)
    settings = {
        "apiVersion": "config.kueue.x-k8s.io/v1beta2",
        "kind": "Configuration",
        "webhook": {"port": 443, "certDir": str(certificates)},
        "leaderElection": {"leaderElect": False},
        "featureGates": {"VisibilityOnDemand": False},
        "integrations": {"frameworks": ["batch/job"]},
        "multiKueue": multikueue,
    }
    config.write_text(json.dumps(settings))
    _install_chart(
        cluster,
        "--set=controllerManager.replicas=0",
        f"--set-file=managerConfig.controllerManagerConfigYaml={config}",
    )
    _lead_to_process(cluster)
    manager = cluster.bed.spawn(
        "kueue",
        [gobuild.build(programs.KUEUE), f"--config={config}", "--zap-log-level=2"],
        env={"KUBECONFIG": str(cluster.inner_kubeconfig), **HTTP2},
    )
    wait_for(
        "Kueue's certificate",
        lambda: _mount(cluster, certificates),
        failed=manager.failure,
    )
    wait_for("Kueue", lambda: _answers(cluster), failed=manager.failure)


def _install_chart(cluster: Cluster, *arguments: str) -> None:
    chart = gobuild.source(programs.KUEUE.module, programs.KUEUE.version) / "charts" / "kueue"
    helm(
        *(cluster, "install", "kueue", chart, f"--namespace={NAMESPACE}", "--create-namespace"),
        *arguments,
    )


def _lead_to_process(cluster: Cluster) -> None:
    """Let the API server find the webhooks on the loopback instead of behind a Service's address.

    The name in the certificate stays the Service's.
    """
    where = {"spec": {"type": "ExternalName", "externalName": "127.0.0.1", "selector": None}}
    cluster.kubectl(
        *(f"--namespace={NAMESPACE}", "patch", "service", "kueue-webhook-service"),
        f"--patch={json.dumps(where)}",
    )
    versions = ("v1beta1", "v1beta2")
    cluster.kubectl(
        "delete", "apiservice", *(f"{version}.visibility.kueue.x-k8s.io" for version in versions)
    )


def _mount(cluster: Cluster, folder: Path) -> bool:
    """Do what a kubelet does with the Secret that the manager makes; say whether it is there."""
    secret = cluster.get(f"--namespace={NAMESPACE}", "secret", "kueue-webhook-server-cert")
    data = secret.get("data")
    if not isinstance(data, dict):
        return False
    for name, content in data.items():
        (folder / name).write_bytes(base64.b64decode(content))
    return True


def _answers(cluster: Cluster) -> bool:
    """Whether the webhooks of Jobs and queues, and what converts queues, answer."""
    queue = {
        "apiVersion": "kueue.x-k8s.io/v1beta1",
        "kind": "ClusterQueue",
        "metadata": {"name": "probe"},
    }
    try:
        cluster.kubectl("create", "--dry-run=server", "--filename=-", stdin=json.dumps(queue))
    except StartFailed:
        return False
    return True
