"""Policies that change the pods of a namespace when they are created, as a mesh does."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robovast_testbed import images
from robovast_testbed.kubernetes import Manifest

from support.kube.lab import Lab
from support.patience import eventually

GROUP = "admissionregistration.k8s.io/v1"

END = 'trap "exit 0" TERM; sleep 100000 & wait'
"""What a container executes that ends only when it is asked to."""


def patch(op: str, path: str, value: object) -> str:
    """An operation of a policy; strings in the value that begin with `=` are CEL expressions."""
    return f"JSONPatch{{op: {_cel(op)}, path: {_cel(path)}, value: {_cel(value)}}}"


def _cel(value: object) -> str:
    if isinstance(value, str) and value.startswith("="):
        return value[1:]
    if isinstance(value, Mapping):
        # The values of a map have one type in the CEL of Kubernetes.
        return "{" + ", ".join(f"{_cel(k)}: dyn({_cel(v)})" for k, v in value.items()) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(_cel, value)) + "]"
    return json.dumps(value)


def container(name: str, script: str, **more: Any) -> dict[str, Any]:
    """A container that a mesh may add to a pod, also where Pod Security is `restricted`."""
    return {
        "name": name,
        "image": images.SLIM,
        "command": ["bash", "-c", script],
        "imagePullPolicy": "IfNotPresent",
        "resources": {"requests": {"cpu": "10m", "memory": "32Mi"}},
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "capabilities": {"drop": ["ALL"]},
        },
        **more,
    }


def policy(name: str, namespaces: Sequence[str], *patches: str, role: str = "") -> list[Manifest]:
    """A policy that changes new pods.

    Args:
        name: of the policy.
        namespaces: whose pods.
        patches: what is done to each.
        role: of the pods (default: all pods of campaigns).
    """
    chosen: dict[str, Any] = {"key": "robovast.io/role", "operator": "Exists"}
    if role:
        chosen |= {"operator": "In", "values": [role]}
    spaces = {
        "key": "kubernetes.io/metadata.name",
        "operator": "In",
        "values": list(namespaces),
    }
    rule = {
        "apiGroups": [""],
        "apiVersions": ["v1"],
        "operations": ["CREATE"],
        "resources": ["pods"],
    }
    spec = {
        "failurePolicy": "Fail",
        "reinvocationPolicy": "Never",
        "matchConstraints": {
            "namespaceSelector": {"matchExpressions": [spaces]},
            "objectSelector": {"matchExpressions": [chosen]},
            "resourceRules": [rule],
        },
        "mutations": [
            {"patchType": "JSONPatch", "jsonPatch": {"expression": f"[{', '.join(patches)}]"}}
        ],
    }
    return list(_objects(name, spec))


def _objects(name: str, spec: dict[str, Any]) -> Iterator[Manifest]:
    for kind, content in (
        ("MutatingAdmissionPolicy", spec),
        ("MutatingAdmissionPolicyBinding", {"policyName": name}),
    ):
        yield {"apiVersion": GROUP, "kind": kind, "metadata": {"name": name}, "spec": content}


def enforce(lab: Lab, text: str, *patches: str, role: str = "") -> None:
    """Apply a policy to a namespace, in place of an earlier one, and wait until it holds.

    Args:
        lab: the namespace.
        text: what the policy adds to a pod; with a leading `-`, what it adds no longer.
        patches: what is done to each pod.
        role: of the pods (default: all pods of campaigns).
    """
    lab.cluster.apply(*policy(f"policy-{lab.namespace}", [lab.namespace], *patches, role=role))
    user = {"runAsNonRoot": True, "runAsUser": 1000, "seccompProfile": {"type": "RuntimeDefault"}}
    probe = {
        "apiVersion": "v1",
        "kind": "Pod",
        "metadata": {"name": "probe", "labels": {"robovast.io/role": role or "shard"}},
        "spec": {
            "securityContext": user,
            "initContainers": [container("first", "true")],
            "containers": [container("second", "true")],
        },
    }

    def holds() -> bool:
        words = ("create", "--dry-run=server", "--output=json", "--filename=-")
        found = lab.kubectl(*words, stdin=json.dumps(probe))
        return (text.removeprefix("-") in found) is not text.startswith("-")

    eventually(holds, told=f"pods have {text}")
