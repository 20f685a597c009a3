"""Kubernetes Events: one for each change of a condition that matters to people. Pure functions.

An Event is created before the status is written, under a name that is derived from the change. So
if an answer is lost, or the operator restarts, the repeated creation finds the existing Event.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from robovast.base.errors import without_userinfo
from robovast.base.printable import printable
from robovast.kubeapi.resources import API_VERSION
from robovast.kubeapi.status import Condition
from robovast_operator.kube.objects import Identity, Object

_ANNOUNCED = {
    ("Accepted", "True"): "Normal",
    ("Accepted", "False"): "Warning",
    ("Stalled", "True"): "Warning",
    ("Succeeded", "True"): "Normal",
    ("Succeeded", "False"): "Warning",
    ("Passed", "True"): "Normal",
    ("Passed", "False"): "Warning",
    ("ResultsAvailable", "True"): "Normal",
}
"""Conditions that get an Event when they change, and its type."""


@dataclass(frozen=True)
class EventContent:
    """The content of an Event."""

    kind: str
    """`Normal` or `Warning`."""
    reason: str
    text: str
    about: str
    """The subject: there is one Event for each reason and subject."""


def messages(old: Iterable[Condition], new: Iterable[Condition]) -> Iterator[EventContent]:
    """Generate the messages about changes from one status to the next."""
    before = {c.type: (c.status, c.reason, c.last_transition_time) for c in old}
    conditions = list(new)
    announced: set[tuple[str, str]] = set()
    for condition in conditions:
        kind = _ANNOUNCED.get((condition.type, condition.status))
        was = before.get(condition.type, ("", "", ""))
        if kind is None or was[:2] == (condition.status, condition.reason):
            continue
        if (condition.reason, condition.message) in announced:
            continue  # another condition has the same message
        announced.add((condition.reason, condition.message))
        change = " ".join((condition.type, condition.status, *was))
        yield EventContent(kind, condition.reason, condition.message or _default(condition), change)


def _default(condition: Condition) -> str:
    return f"The condition {condition.type} is {condition.status}."


def event(identity: Identity, message: EventContent, now: str) -> Object:
    """Return the Event object of a message about a Campaign."""
    text = f"{identity.uid}{message.reason}{message.about}"
    mark = hashlib.sha256(text.encode()).hexdigest()[:12]
    return {
        "apiVersion": "v1",
        "kind": "Event",
        "metadata": {"name": f"{identity.name}.{mark}", "namespace": identity.namespace},
        "involvedObject": {
            "apiVersion": API_VERSION,
            "kind": "Campaign",
            "name": identity.name,
            "namespace": identity.namespace,
            "uid": identity.uid,
        },
        "type": message.kind,
        "reason": message.reason,
        "message": printable(without_userinfo(message.text))[:1000],
        "source": {"component": "robovast-operator"},
        "firstTimestamp": now,
        "lastTimestamp": now,
        "count": 1,
    }
