"""Builds the common part of all our pods: permissions, resources, and the meaning of exit codes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from robovast.kubeapi.pod_contract.mounts import Mount, Object
from robovast.kubeapi.resources import NodeAffinity, NodeRequirement, Scheduling

PROGRAM = ("python", "-m", "robovast.agent")

OWN_USER = 1000
"""User id of our own containers in pods without a run's files."""

AGENT_RESOURCES: Object = {
    "requests": {"cpu": "10m", "memory": "64Mi"},
    "limits": {"memory": "512Mi"},
}
"""Resources of our containers in the pod of a run; the CPU request is small because they idle.

They have no limit on ephemeral storage: Kubernetes adds up the limits of a pod's containers and
counts its volumes, so a small limit here would be a limit on what the run writes.
"""

TASK_RESOURCES: Object = {
    "requests": {"cpu": "100m", "memory": "256Mi"},
    "limits": {"memory": "2Gi"},
}
"""Resources of our containers in Jobs for a whole campaign, such as the index Job."""


LINUX = {"kubernetes.io/os": "linux"}
"""Label of the nodes that can run our containers: clusters also have Windows nodes."""


def confined_pod(
    user: int,
    grace: int,
    scheduling: Scheduling,
    node_labels: Mapping[str, str] | None = None,
    architectures: Sequence[str] = (),
) -> Object:
    """Build a pod spec without a service account token that selects allowed Linux nodes.

    Args:
        user: number of the user who owns the files on its volumes.
        grace: termination grace period [s].
        scheduling: scheduling of the campaign's spec.
        node_labels: labels of the allowed nodes, in addition to those of `scheduling`.
        architectures: processor architectures of our image, for example `amd64` (default: any).
    """
    spec: Object = {
        "restartPolicy": "Never",
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "terminationGracePeriodSeconds": grace,
        "securityContext": {
            "runAsUser": user,
            "runAsGroup": user,
            "fsGroup": user,
            "runAsNonRoot": user != 0,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
    }
    own = {"node_affinity", "topology_spread", "pod_annotations", "pod_labels"}
    given = scheduling.model_dump(by_alias=True, exclude_none=True, exclude=own)
    given["nodeSelector"] = {**LINUX, **(node_labels or {}), **given["nodeSelector"]}
    given["affinity"] = _affinity(scheduling.node_affinity, architectures)
    return spec | {name: value for name, value in given.items() if value}


def _affinity(nodes: NodeAffinity, architectures: Sequence[str]) -> Object:
    """Build the affinity of a pod; empty if it may be on any node."""
    found: Object = {}
    required = [_expression(item) for item in nodes.required]
    if architectures:
        required.append(
            {"key": "kubernetes.io/arch", "operator": "In", "values": list(architectures)}
        )
    if required:
        terms = [{"matchExpressions": required}]
        found["requiredDuringSchedulingIgnoredDuringExecution"] = {"nodeSelectorTerms": terms}
    if nodes.preferred:
        found["preferredDuringSchedulingIgnoredDuringExecution"] = [
            {"weight": item.weight, "preference": {"matchExpressions": [_expression(item)]}}
            for item in nodes.preferred
        ]
    return {"nodeAffinity": found} if found else {}


def _expression(item: NodeRequirement) -> Object:
    values = {"values": item.values} if item.values else {}
    return {"key": item.key, "operator": item.operator, **values}


def spread(scheduling: Scheduling, labels: Mapping[str, str]) -> list[Object]:
    """How pods are spread over nodes.

    Args:
        scheduling: what the author of their campaign asks for.
        labels: of the pods that are counted.
    """
    return [
        item.model_dump(by_alias=True) | {"labelSelector": {"matchLabels": dict(labels)}}
        for item in scheduling.topology_spread
    ]


def own_container(
    image: str,
    name: str,
    arguments: Sequence[str],
    mounts: Iterable[Mount],
    resources: Object = AGENT_RESOURCES,
    variables: Iterable[Object] = (),
) -> Object:
    """A container of our own image.

    Args:
        image: our own.
        name: of the container.
        arguments: of the agent, its command first.
        mounts: mounts beside the pod's own volume.
        resources: requests and limits.
        variables: environment variables.
    """
    folders = [{"name": folder, "value": Mount.WORK.path} for folder in ("HOME", "TMPDIR")]
    return {
        "name": name,
        "image": image,
        "command": [*PROGRAM, *arguments],
        "resources": resources,
        "securityContext": confined() | {"readOnlyRootFilesystem": True},
        "env": [*folders, *variables],
        "terminationMessagePolicy": "FallbackToLogsOnError",
        "volumeMounts": [mount.mount for mount in (Mount.WORK, *mounts)],
    }


def confined(restricted: bool = True) -> Object:
    """The security context of a container, unless an administrator allows everything."""
    if not restricted:
        return {}
    return {"allowPrivilegeEscalation": False, "capabilities": {"drop": ["ALL"]}}


def failure_policy(end: Literal["FailIndex", "FailJob"], container: str, *rules: Object) -> Object:
    """Build the pod failure policy of a Job; only our own containers cause a retry.

    A disrupted pod costs no retry. A pod that fails although our container ended with 0 has done
    its work: a container that admission added has failed, or kept the pod alive. Kubernetes cannot
    count such a pod as succeeded, so its index (or Job) ends as failed, without another pod, and
    the operator reads the verdicts. A pod that is not initialized has not started our container.

    Args:
        end: action for a pod that has done its work.
        container: name of our container whose end is the end of the pod's work.
        rules: rules that come first.
    """
    disrupted = {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget"}]}
    code = {"containerName": container, "operator": "NotIn", "values": [0]}
    started = [{"type": "Initialized", "status": "True"}]
    last = ({"action": "Count", "onExitCodes": code}, {"action": end, "onPodConditions": started})
    return {
        "podReplacementPolicy": "Failed",
        "podFailurePolicy": {"rules": [*rules, disrupted, *last]},
    }


def on_exit(action: str, container: str, codes: Iterable[int]) -> Object:
    """A rule of such a policy for a container's exit codes."""
    return {
        "action": action,
        "onExitCodes": {
            "containerName": container,
            "operator": "In",
            "values": sorted(map(int, codes)),
        },
    }
