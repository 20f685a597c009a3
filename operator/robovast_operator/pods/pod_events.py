"""Reads Events about pods that are not created or do not start. Pure functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import datetime

from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import clause
from robovast_operator.kube.times import parse_time
from robovast_operator.kube.untrusted_fields import mapping, mappings, text, time
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.own import container_specs, containers_of, foreign_names
from robovast_operator.pods.pod_status import foreign_trouble

_CAUSES = {
    "FailedMount": "ContainerConfigError",
    "FailedCreatePodSandBox": "ContainerError",
    "FailedCreate": "RequestDenied",
}
"""Reason of a Trouble by the reason of an Event that no pod status contains."""

DENIALS = frozenset({"QuotaExceeded", "RequestDenied"})
"""Reasons of a Trouble that the API server creates no pod."""

_STEPS = frozenset({"Scheduled", "Pulled", "Created", "Started", "SuccessfulCreate"})
"""Reasons of Events that report progress."""

_CONDITIONS = frozenset(
    {"PodScheduled", "PodReadyToStartContainers", "Initialized", "ContainersReady", "Ready"}
)
"""Conditions of a pod that become true with its progress."""


def trouble_of_events(events: Iterable[Object], last_progress: datetime) -> Trouble | None:
    """Find in the latest Event why a pod is not created or does not start.

    Args:
        events: of the pod, or of the Job that creates pods.
        last_progress: time of the last progress; earlier Events are ignored.
    """
    found = problem_of_events(events, last_progress)
    if found is None:
        return None
    reason, cause = found
    what = "create a pod" if reason in DENIALS else "start a pod"
    return Trouble(reason, f"Kubernetes cannot {what}: {clause(cause)}. {_CHECK}")


_CHECK = (
    "Check the Secrets, volumes and resources of the campaign, or ask your cluster administrator."
)


def problem_of_events(events: Iterable[Object], last_progress: datetime) -> tuple[str, str] | None:
    """Return why a pod does not start: the reason of the condition, and the message of the Event.

    Args:
        events: of the pod, or of the Job that creates pods.
        last_progress: time of the last progress; earlier Events are ignored.
    """
    relevant = [event for event in events if text(event.get("reason")) in {*_CAUSES, *_STEPS}]
    last = max(relevant, key=lambda event: (_time(event), event["reason"] in _STEPS), default={})
    reason = _CAUSES.get(text(last.get("reason")))
    if reason is None or _time(last) <= last_progress:
        return None
    message = text(last.get("message"))
    quota = reason == "RequestDenied" and "exceeded quota" in message
    return ("QuotaExceeded" if quota else reason), message


def _time(event: Object) -> datetime:
    """Return when the reported condition last occurred."""
    series, meta = mapping(event.get("series")), mapping(event.get("metadata"))
    given = (
        *(event.get("lastTimestamp"), event.get("eventTime")),
        *(series.get("lastObservedTime"), meta.get("creationTimestamp")),
    )
    return max(parse_time(time(each)) for each in given)


def last_success(*pods: Object, since: str = "") -> datetime:
    """Return the time of the last progress of pods, by their status.

    Args:
        pods: any number.
        since: start time of their Job.
    """
    states = [
        mapping(state)
        for pod in pods
        for container in containers_of(pod)
        for kind in ("state", "lastState")
        for state in mapping(container.get(kind)).values()
    ]
    conditions = [item for pod in pods for item in mappings(pod["status"].get("conditions"))]
    given = (
        since,
        *(pod["metadata"].get("creationTimestamp") for pod in pods),
        *(state.get("startedAt") for state in states),
        *(state.get("finishedAt") for state in states if state.get("exitCode") == 0),
        *(
            condition.get("lastTransitionTime")
            for condition in conditions
            if condition.get("status") == "True" and condition.get("type") in _CONDITIONS
        ),
    )
    return max(parse_time(time(each)) for each in given)


def hook_trouble(pod: Object, events: Sequence[Object]) -> Trouble | None:
    """Find the `postStart` hook that keeps a pod from starting.

    While a hook runs, the status of its container is still `waiting`, although the container has
    started. The kubelet starts the next container only when the hook has ended.
    """
    reasons: dict[str, set[str]] = {}
    for event in events:
        place = text(mapping(event.get("involvedObject")).get("fieldPath"))
        if found := re.search(r"\{(.+)\}$", place):
            reasons.setdefault(found[1], set()).add(text(event.get("reason")))
    begun = [spec for spec in container_specs(pod["spec"]) if spec.get("name") in reasons]
    if not begun or not mapping(begun[-1].get("lifecycle")).get("postStart"):
        return None
    name = text(begun[-1].get("name"))
    status = next((each for each in containers_of(pod) if each["name"] == name), {})
    begins = not (status.get("ready") or mapping(status.get("state")).get("terminated"))
    if not begins or "Started" not in reasons[name]:
        return None
    how = "has not finished the `postStart` hook"
    if name in foreign_names(pod):
        return foreign_trouble(pod, name, how)
    message = (
        f"Container {name} in pod {pod['metadata']['name']} {how}. The pod starts when the hook "
        "ends. Check the command of the hook."
    )
    return Trouble("ContainerError", message)
