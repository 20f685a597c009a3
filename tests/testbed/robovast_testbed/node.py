"""A real node: containerd, kubelet, kube-proxy and cluster DNS."""

import json
from collections.abc import Iterable
from pathlib import Path

from . import containerd, controlplane, debian, gobuild, network, programs, scratch
from .commands import wait_for
from .kubernetes import Cluster, write_kubeconfig

NAME = "testbed"
MANIFESTS = Path(__file__).parent.parent / "manifests"


def start(cluster: Cluster, archives: Iterable[Path] = ()) -> None:
    """Add a real node to a cluster and wait until it runs pods that find each other by name.

    :param archives: images in `docker save` format that pods shall find there.
    :raises Unavailable: when the machine lacks root, Go or a Debian package.
    :raises StartFailed: when the node is not ready in time.
    """
    debian.require("conntrack", "iptables")
    engine = containerd.start(cluster.bed)
    kubelet = programs.spawn(cluster.bed, "kubelet", _kubelet(cluster, engine))
    programs.spawn(cluster.bed, "kube-proxy", _proxy(cluster))
    for archive in (scratch.archive(gobuild.build(programs.COREDNS)), *archives):
        engine.load(archive)
    cluster.kubectl("apply", "--server-side", "--filename", MANIFESTS / "coredns.yaml")
    wait_for("node", lambda: _is_ready(cluster), failed=kubelet.failure)
    cluster.kubectl(
        *("--namespace=kube-system", "rollout", "status", "deployment/coredns", "--timeout=180s")
    )


def _is_ready(cluster: Cluster) -> bool:
    query = "{.status.conditions[?(@.type=='Ready')].status}"
    found = cluster.kubectl(
        *("get", "node", NAME, "--ignore-not-found", f"--output=jsonpath={query}")
    )
    return found == "True"


def _kubelet(cluster: Cluster, engine: containerd.Containerd) -> list[str]:
    authority = controlplane.authority_of(cluster)
    client = authority.issue("kubelet", f"system:node:{NAME}", group="system:nodes")
    kubeconfig = cluster.folder / "kubelet.kubeconfig"
    write_kubeconfig(kubeconfig, controlplane.INNER_URL, authority.root, client)
    serving = authority.issue("kubelet-serving", NAME, sans=(f"IP:{network.NODE_IP}",))
    config = {
        "apiVersion": "kubelet.config.k8s.io/v1beta1",
        "kind": "KubeletConfiguration",
        "authentication": {
            "anonymous": {"enabled": False},
            "webhook": {"enabled": False},
            "x509": {"clientCAFile": str(authority.root.file)},
        },
        "authorization": {"mode": "AlwaysAllow"},
        "tlsCertFile": str(serving.file),
        "tlsPrivateKeyFile": str(serving.key),
        "clusterDNS": [network.DNS_SERVICE_IP],
        "clusterDomain": "cluster.local",
        "resolvConf": "",
        "containerRuntimeEndpoint": engine.endpoint,
        "cgroupDriver": "cgroupfs",
        "cgroupRoot": cluster.bed.cgroup,
        "cgroupsPerQOS": False,
        "enforceNodeAllocatable": [],
        "failCgroupV1": False,
        "failSwapOn": False,
        "featureGates": {"KubeletInUserNamespace": True},
        # How long a changed Secret takes to reach a mounted volume; Kueue starts by waiting for it.
        "syncFrequency": "2s",
        # How soon a volume that has outgrown its limit is noticed.
        "volumeStatsAggPeriod": "5s",
        # The machine's own disk may be nearly full; images cannot be pulled again.
        "imageGCHighThresholdPercent": 100,
        "evictionHard": {"imagefs.available": "0%", "nodefs.available": "0%"},
    }
    file = cluster.folder / "kubelet.json"
    file.write_text(json.dumps(config))
    return [
        f"--config={file}",
        f"--kubeconfig={kubeconfig}",
        f"--hostname-override={NAME}",
        f"--node-ip={network.NODE_IP}",
    ]


def _proxy(cluster: Cluster) -> list[str]:
    return [
        f"--kubeconfig={cluster.folder}/proxy.kubeconfig",
        f"--hostname-override={NAME}",
        "--proxy-mode=iptables",
        # Pods share one bridge: without it, answers would bypass the translation of addresses.
        "--masquerade-all",
        "--conntrack-max-per-core=0",
        "--conntrack-tcp-timeout-established=0",
        "--conntrack-tcp-timeout-close-wait=0",
    ]
