"""etcd, API server, controller manager and scheduler."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

from . import network, pki, programs
from .bed import Bed
from .commands import run, wait_for
from .kubernetes import Cluster, Manifest, write_kubeconfig

PORT = 6443
INNER_URL = f"https://{network.NODE_IP}:{PORT}"
ETCD = "http://127.0.0.1:2379"
SYSTEM_USERS = {
    "controller-manager": "system:kube-controller-manager",
    "scheduler": "system:kube-scheduler",
    "proxy": "system:kube-proxy",
}
# A controller costs requests at the start of the manager, which are limited to 20 a second:
# only those that tests have a use for run.
CONTROLLERS = (
    "clusterrole-aggregation",
    "cronjob",
    "daemonset",
    "deployment",
    "disruption",
    "endpointslice",
    "garbage-collector",
    "job",
    "namespace",
    "node-lifecycle",
    "persistentvolume-binder",
    "persistentvolumeclaim-protection",
    "pod-garbage-collector",
    "replicaset",
    "resourcequota",
    "root-ca-certificate-publisher",
    "serviceaccount",
    "serviceaccount-token",
    "statefulset",
    "taint-eviction",
    "ttl-after-finished",
)
AUDIT_POLICY = {
    "apiVersion": "audit.k8s.io/v1",
    "kind": "Policy",
    "omitStages": ["RequestReceived"],
    "rules": [{"level": "Metadata"}],
}
STORAGE_CLASS = "standard"
VOLUMES = 8


def start(bed: Bed, manager_requests: int = 20, version: str = programs.KUBERNETES) -> Cluster:
    """Start a control plane without nodes and wait until it serves pods.

    :param manager_requests: requests that the controller manager may make in a second; 20 is
        its own default.
    :param version: of Kubernetes: the newest or the oldest that is promised.
    :raises Unavailable: when the machine lacks root, Go or a Debian package.
    :raises StartFailed: when it is not ready in time.
    """
    cluster = Cluster(bed)
    network.create_bridge(bed)
    authority = pki.create(cluster.folder / "pki")
    _write_kubeconfigs(cluster, authority)
    programs.spawn(bed, "etcd", _etcd(cluster.folder), version)
    api = programs.spawn(bed, "kube-apiserver", _api_server(cluster, authority), version)
    wait_for("kube-apiserver", lambda: _ready(cluster), failed=api.failure)
    arguments = _controller_manager(cluster.folder, authority, manager_requests)
    manager = programs.spawn(bed, "kube-controller-manager", arguments, version)
    programs.spawn(bed, "kube-scheduler", _scheduler(cluster.folder), version)
    wait_for(
        "kube-controller-manager",
        lambda: "default" in cluster.kubectl("get", "serviceaccounts", "--output=name"),
        failed=manager.failure,
    )
    cluster.apply(*_storage(cluster.folder / "volumes"))
    return cluster


def _storage(folder: Path) -> Iterator[Manifest]:
    """A default class with volumes that any user of a pod may write into.

    The manager's own provisioner makes folders for root alone.
    """
    yield {
        "apiVersion": "storage.k8s.io/v1",
        "kind": "StorageClass",
        "metadata": {
            "name": STORAGE_CLASS,
            "annotations": {"storageclass.kubernetes.io/is-default-class": "true"},
        },
        "provisioner": "kubernetes.io/no-provisioner",
    }
    for index in range(VOLUMES):
        volume = folder / str(index)
        volume.mkdir(parents=True)
        volume.chmod(0o777)
        yield {
            "apiVersion": "v1",
            "kind": "PersistentVolume",
            "metadata": {"name": f"volume-{index}"},
            "spec": {
                "storageClassName": STORAGE_CLASS,
                "capacity": {"storage": "10Gi"},
                "accessModes": ["ReadWriteOnce"],
                "hostPath": {"path": str(volume)},
            },
        }


def authority_of(cluster: Cluster) -> pki.Authority:
    """Return the certificate authority of a running cluster."""
    folder = cluster.folder / "pki"
    return pki.Authority(pki.Certificate(folder / "ca.crt", folder / "ca.key"))


def _write_kubeconfigs(cluster: Cluster, authority: pki.Authority) -> None:
    outer = f"https://127.0.0.1:{network.publish(cluster.bed, PORT)}"
    admin = authority.issue("admin", "admin", group="system:masters")
    write_kubeconfig(cluster.kubeconfig, outer, authority.root, admin)
    write_kubeconfig(cluster.inner_kubeconfig, INNER_URL, authority.root, admin)
    for name, user in SYSTEM_USERS.items():
        certificate = authority.issue(name, user)
        write_kubeconfig(
            cluster.folder / f"{name}.kubeconfig", INNER_URL, authority.root, certificate
        )


def _ready(cluster: Cluster) -> bool:
    probe: list[str | Path] = [programs.kubectl()]
    probe.append(f"--kubeconfig={cluster.kubeconfig}")
    probe += ["get", "--raw=/readyz"]
    answer = subprocess.run(probe, capture_output=True, check=False)
    return answer.returncode == 0


def _etcd(folder: Path) -> list[str]:
    return [
        f"--data-dir={folder}/etcd",
        f"--listen-client-urls={ETCD}",
        f"--advertise-client-urls={ETCD}",
        "--listen-peer-urls=http://127.0.0.1:2380",
        "--unsafe-no-fsync",
        "--log-level=warn",
    ]


def _api_server(cluster: Cluster, authority: pki.Authority) -> list[str]:
    folder = cluster.folder
    sans = ("127.0.0.1", network.NODE_IP, network.API_SERVICE_IP)
    names = ("localhost", "kubernetes", "kubernetes.default.svc")
    serving = authority.issue(
        "api-server",
        "kube-apiserver",
        sans=(*(f"IP:{ip}" for ip in sans), *(f"DNS:{name}" for name in names)),
    )
    to_kubelet = authority.issue("api-to-kubelet", "kube-apiserver", group="system:masters")
    front_proxy = authority.issue("front-proxy", "front-proxy")
    policy = folder / "audit-policy.json"
    policy.write_text(json.dumps(AUDIT_POLICY))
    key = folder / "pki" / "service-accounts.key"
    run(["openssl", "genpkey", "-algorithm", "RSA", "-out", key])
    return [
        f"--etcd-servers={ETCD}",
        "--bind-address=0.0.0.0",
        f"--secure-port={PORT}",
        f"--advertise-address={network.NODE_IP}",
        f"--service-cluster-ip-range={network.SERVICE_CIDR}",
        "--authorization-mode=Node,RBAC",
        "--enable-admission-plugins=NodeRestriction",
        "--allow-privileged=true",
        f"--cert-dir={folder}/pki",
        f"--client-ca-file={authority.root.file}",
        f"--tls-cert-file={serving.file}",
        f"--tls-private-key-file={serving.key}",
        "--kubelet-preferred-address-types=InternalIP",
        f"--kubelet-certificate-authority={authority.root.file}",
        f"--kubelet-client-certificate={to_kubelet.file}",
        f"--kubelet-client-key={to_kubelet.key}",
        f"--requestheader-client-ca-file={authority.root.file}",
        "--requestheader-allowed-names=front-proxy",
        "--requestheader-username-headers=X-Remote-User",
        "--requestheader-group-headers=X-Remote-Group",
        "--requestheader-extra-headers-prefix=X-Remote-Extra-",
        f"--proxy-client-cert-file={front_proxy.file}",
        f"--proxy-client-key-file={front_proxy.key}",
        "--service-account-issuer=https://kubernetes.default.svc",
        f"--service-account-key-file={key}",
        f"--service-account-signing-key-file={key}",
        f"--audit-policy-file={policy}",
        f"--audit-log-path={cluster.audit_log}",
        "--audit-log-maxsize=8192",  # [MB]: whoever counts requests needs one file
    ]


def _controller_manager(folder: Path, authority: pki.Authority, requests: int) -> list[str]:
    return [
        f"--kube-api-qps={requests}",
        f"--kube-api-burst={requests * 3 // 2}",
        f"--kubeconfig={folder}/controller-manager.kubeconfig",
        "--leader-elect=false",
        "--secure-port=0",
        "--use-service-account-credentials=true",
        f"--controllers={','.join(f'{name}-controller' for name in CONTROLLERS)}",
        f"--root-ca-file={authority.root.file}",
        f"--service-account-private-key-file={folder}/pki/service-accounts.key",
        f"--cluster-signing-cert-file={authority.root.file}",
        f"--cluster-signing-key-file={authority.root.key}",
    ]


def _scheduler(folder: Path) -> list[str]:
    return [
        f"--kubeconfig={folder}/scheduler.kubeconfig",
        "--leader-elect=false",
        "--secure-port=0",
    ]
