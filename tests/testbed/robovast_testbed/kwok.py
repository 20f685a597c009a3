"""Fake nodes, on which pods take no time and no memory."""

from collections.abc import Sequence
from pathlib import Path

from . import gobuild, programs
from .commands import wait_for
from .kubernetes import Cluster, Manifest

ANNOTATION = "kwok.x-k8s.io/node"
LABELS = {"type": "kwok", "kubernetes.io/os": "linux", "kubernetes.io/arch": "amd64"}
TAINT = {"key": ANNOTATION, "value": "fake", "effect": "NoSchedule"}
CAPACITY = {"cpu": "64", "memory": "256Gi", "pods": "1000", "ephemeral-storage": "1Ti"}
STAGES = ("node/fast", "pod/fast")


def start(
    cluster: Cluster, nodes: int, *, tainted: bool = False, stages: Sequence[str] = ()
) -> None:
    """Add fake nodes; pods of Jobs that land there complete at once.

    :param nodes: how many; they are called `kwok-0`, `kwok-1` …
    :param stages: further Stages as YAML; they come before the usual ones when they match.
    :param tainted: keep pods away that do not tolerate `kwok.x-k8s.io/node=fake:NoSchedule`.
    """
    config = cluster.folder / "kwok.yaml"
    usual = (file.read_text() for file in _stage_files())
    config.write_text("\n---\n".join([*stages, *usual]))
    daemon = cluster.bed.spawn(
        "kwok",
        [
            gobuild.build(programs.KWOK),
            f"--kubeconfig={cluster.inner_kubeconfig}",
            f"--config={config}",
            "--manage-all-nodes=false",
            f"--manage-nodes-with-annotation-selector={ANNOTATION}=fake",
            "--node-lease-duration-seconds=40",
        ],
    )
    cluster.apply(*(_node(f"kwok-{index}", tainted) for index in range(nodes)))
    wait_for("kwok", lambda: _ready(cluster) == nodes, failed=daemon.failure)


def _stage_files() -> list[Path]:
    stages = gobuild.source(programs.KWOK.module, programs.KWOK.version) / "kustomize" / "stage"
    files = (file for name in STAGES for file in sorted((stages / name).glob("*.yaml")))
    return [file for file in files if file.name != "kustomization.yaml"]


def _node(name: str, tainted: bool) -> Manifest:
    return {
        "apiVersion": "v1",
        "kind": "Node",
        "metadata": {
            "name": name,
            "annotations": {ANNOTATION: "fake"},
            "labels": LABELS | {"kubernetes.io/hostname": name},
        },
        "spec": {"taints": [TAINT] if tainted else []},
        "status": {"allocatable": CAPACITY, "capacity": CAPACITY},
    }


def _ready(cluster: Cluster) -> int:
    query = "{range .items[*]}{.status.conditions[?(@.type=='Ready')].status}{'\\n'}{end}"
    answer = cluster.kubectl("get", "nodes", "--selector=type=kwok", f"--output=jsonpath={query}")
    return answer.split().count("True")
