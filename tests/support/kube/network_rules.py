"""What NetworkPolicies let through, as their API defines it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

Policy = dict[str, Any]


@dataclass(frozen=True)
class Peer:
    """A pod, or an address outside of the cluster when it has no labels."""

    namespace: str = ""
    labels: dict[str, str] = field(default_factory=dict)
    ports: dict[str, int] = field(default_factory=dict)
    """Named ports of its containers."""


def lets_through(
    policies: list[Policy], home: str, source: Peer, target: Peer, port: int, protocol: str = "TCP"
) -> bool:
    """Whether a connection is possible.

    Args:
        policies: all of the cluster.
        home: namespace of those that state none.
        source: who connects.
        target: to whom.
        port: of the target.
        protocol: TCP or UDP.
    """
    return all(
        _allowed(policies, home, direction, subject, other, (target, port, protocol))
        for direction, subject, other in (("Egress", source, target), ("Ingress", target, source))
    )


def _allowed(
    policies: list[Policy],
    home: str,
    direction: str,
    subject: Peer,
    other: Peer,
    where: tuple[Peer, int, str],
) -> bool:
    mine = [
        (policy["metadata"].get("namespace", home), policy["spec"])
        for policy in policies
        if policy["metadata"].get("namespace", home) == subject.namespace
        and _selects(policy["spec"]["podSelector"], subject.labels)
        and direction in policy["spec"]["policyTypes"]
    ]
    peers = "to" if direction == "Egress" else "from"
    return not mine or any(
        _has_port(rule, *where) and _has_peer(rule.get(peers), namespace, other)
        for namespace, spec in mine
        for rule in spec.get(direction.lower(), ())
    )


def _has_port(rule: Any, target: Peer, port: int, protocol: str) -> bool:
    return "ports" not in rule or any(
        target.ports.get(item["port"], item["port"]) == port and item["protocol"] == protocol
        for item in rule["ports"]
    )


def _has_peer(peers: Any, namespace: str, other: Peer) -> bool:
    return not peers or any(_is(peer, namespace, other) for peer in peers)


def _is(peer: Any, namespace: str, other: Peer) -> bool:
    if "ipBlock" in peer:
        return not other.labels and peer["ipBlock"]["cidr"] == other.namespace
    if "namespaceSelector" in peer:
        names = {"kubernetes.io/metadata.name": other.namespace}
        inside = bool(other.labels) and _selects(peer["namespaceSelector"], names)
    else:
        inside = other.namespace == namespace
    return inside and _selects(peer.get("podSelector", {}), other.labels)


def _selects(selector: Any, labels: dict[str, str]) -> bool:
    exact = all(labels.get(key) == value for key, value in selector.get("matchLabels", {}).items())
    return exact and all(
        item["key"] in labels
        and (item["operator"] == "Exists" or labels[item["key"]] in item["values"])
        for item in selector.get("matchExpressions", ())
    )
