"""Determines the resources that a cluster has left for campaigns."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable, Mapping
from typing import Any

from robovast.base.errors import CannotRunError
from robovast.model.quantities import cpus, memory

Json = Mapping[str, Any]


def free_capacity(context: str | None) -> tuple[float, int]:
    """CPUs [cores] and memory [byte] of all nodes that take pods, beside what pods ask for.

    Args:
        context: of the kubeconfig; the current one when None.

    Raises:
        CannotRunError: kubectl is missing, or cannot list nodes and pods.
    """
    running = "--field-selector=status.phase!=Succeeded,status.phase!=Failed"
    nodes = _list(context, "nodes")
    pods = _list(context, "pods", "--all-namespaces", running)
    return capacity_beside(nodes, pods)


def capacity_beside(nodes: Iterable[Json], pods: Iterable[Json]) -> tuple[float, int]:
    """CPUs [cores] and memory [byte] that nodes can allocate, without what pods ask for.

    Args:
        nodes: Node objects; those that take no pods do not count.
        pods: Pod objects that have not ended.
    """
    usable = {n["metadata"]["name"]: n["status"]["allocatable"] for n in nodes if _takes_pods(n)}
    asked = [
        container.get("resources", {}).get("requests", {})
        for pod in pods
        if pod["spec"].get("nodeName") in usable
        for container in pod["spec"]["containers"]
    ]
    free_cpus = _cpus(usable.values()) - _cpus(asked)
    return max(0.0, round(free_cpus, 3)), max(0, _memory(usable.values()) - _memory(asked))


def _takes_pods(node: Json) -> bool:
    taints = node["spec"].get("taints") or ()
    return not any(taint["effect"] in {"NoSchedule", "NoExecute"} for taint in taints)


def _cpus(items: Iterable[Json]) -> float:
    return sum(cpus(item["cpu"], "cpu") or 0 for item in items if _positive(item.get("cpu")))


def _memory(items: Iterable[Json]) -> int:
    return sum(memory(item["memory"], "memory") or 0 for item in items if "memory" in item)


def _positive(value: Any) -> bool:
    return str(value or "0").strip("0m") != ""


def _list(context: str | None, *what: str) -> list[Json]:
    chosen = [f"--context={context}"] if context else []
    command = ["kubectl", *chosen, "get", *what, "--output=json"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise CannotRunError(
            "kubectl is missing, which reads the capacity of the cluster", hint="install `kubectl`"
        ) from None
    except subprocess.CalledProcessError as error:
        raise CannotRunError(f"`{' '.join(command)}`: {error.stderr.strip()}") from error
    items: list[Json] = json.loads(answer.stdout)["items"]
    return items
