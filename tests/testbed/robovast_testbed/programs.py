"""What the testbed runs, by version."""

from collections.abc import Sequence
from pathlib import Path

from .bed import Bed, Daemon
from .gobuild import Program, build_own

KUBERNETES = "1.36.3"
OLDEST_KUBERNETES = "1.33.13"
"""The oldest that the chart promises to work on; without what only a node needs."""
_KUBERNETES_STAMP = "k8s.io/component-base/version"

# Of 3.3 and newer the nested module gitops-engine is not published in the version they need.
ARGOCD = Program("argocd", "github.com/argoproj/argo-cd/v3", "v3.2.11", "./cmd")
COMPOSE = Program(
    name="docker-compose",
    module="github.com/docker/compose/v2",
    version="v2.40.3",
    package="./cmd",
    ldflags="-X github.com/docker/compose/v2/internal.Version=v2.40.3",
)
CONTAINERD = tuple(
    Program(
        name=name,
        module="github.com/containerd/containerd/v2",
        version="v2.2.1",
        package=f"./cmd/{name}",
        ldflags="-X github.com/containerd/containerd/v2/version.Version=v2.2.1",
        tags="no_btrfs no_zfs no_devmapper no_aufs",
    )
    for name in ("containerd", "containerd-shim-runc-v2", "ctr")
)
COREDNS = Program(
    name="coredns",
    module="github.com/coredns/coredns",
    version="v1.14.7",
    registry="core/plugin/zplugin.go",
    plugins=("cache", "errors", "kubernetes", "ready"),  # what manifests/coredns.yaml configures
)
FAKE_GCS = Program(
    name="fake-gcs-server",
    module="github.com/fsouza/fake-gcs-server",
    version="v1.56.1",
    tags="disable_grpc_modules",  # which serve Google's client, a fifth of all packages
)
HELM = Program("helm", "helm.sh/helm/v3", "v3.22.0", "./cmd/helm")
KUEUE = Program("kueue", "sigs.k8s.io/kueue", "v0.16.1", "./cmd/kueue")
KWOK = Program("kwok", "sigs.k8s.io/kwok", "v0.8.0", "./cmd/kwok")
MINIO = Program("minio", "github.com/minio/minio", "v0.0.0-20260212201848-7aac2a2c5b7c")
VERSITYGW = Program("versitygw", "github.com/versity/versitygw", "v1.8.0", "./cmd/versitygw")


def kubelite(version: str = KUBERNETES) -> Path:
    """Return the executable of etcd and of every server of Kubernetes: its argument picks one."""
    if version == OLDEST_KUBERNETES:
        return build_own("kubelite", _stamp(version), tags="controlplane", modfile="oldest.mod")
    return build_own("kubelite", _stamp(version))


def kubectl() -> Path:
    """Return the executable of kubectl."""
    return build_own("kubectl", _stamp(KUBERNETES), modfile="../kubelite/go.mod")


def _stamp(version: str) -> str:
    """The linker's flags that give a program its version."""
    major, minor, _ = version.split(".")
    stamps = {"gitVersion": f"v{version}", "gitMajor": major, "gitMinor": minor}
    return " ".join(f"-X {_KUBERNETES_STAMP}.{k}={v}" for k, v in stamps.items())


def spawn(
    bed: Bed, name: str, arguments: Sequence[str | Path], version: str = KUBERNETES
) -> Daemon:
    """Start one of the programs of `kubelite` in a testbed."""
    return bed.spawn(name, [kubelite(version), name, *arguments])
