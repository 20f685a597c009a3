"""What pods tell: verdicts of those that ended, and why others do not start. Pure functions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta

from robovast.cluster.ranges import parse_ranges
from robovast.cluster.status import Runs
from robovast_operator.campaign import Object
from robovast_operator.picture import Final, Trouble
from robovast_operator.times import parse_time
from robovast_operator.verdicts import Report, parse_report

INDEX_ANNOTATION = "batch.kubernetes.io/job-completion-index"

_WAITING = {
    "ImagePullBackOff": "ImagePull",
    "ErrImagePull": "ImagePull",
    "ErrImageNeverPull": "ImagePull",
    "InvalidImageName": "ImagePull",
    "CreateContainerConfigError": "Configuration",
    "CreateContainerError": "Container",
    "RunContainerError": "Container",
}
"""What a kubelet says of a container that does not start, and the cause for people."""

_EXITS = {74: "Storage", 65: "InvalidDocument", 64: "InvalidPlan", 78: "Incompatible"}
"""Exit codes of our containers (docs/agent.md) that are no verdict."""


def reports_of(pods: Iterable[Object]) -> dict[int, Report]:
    """The verdicts of a Job's failed pods by completion index; of a retried one the last."""
    found: dict[int, tuple[str, Report]] = {}
    for pod in pods:
        index = (pod["metadata"].get("annotations") or {}).get(INDEX_ANNOTATION)
        report = parse_report(_message(pod, "agent"))
        if index is None or report is None:
            continue
        started = pod["metadata"].get("creationTimestamp", "")
        known = found.get(int(index))
        if known is None or known[0] <= started:
            found[int(index)] = (started, report)
    return {index: report for index, (_, report) in found.items()}


def final_of(pods: Iterable[Object]) -> Final | None:
    """What the finish Job's pod found in the bucket."""
    for pod in pods:
        try:
            data = json.loads(_message(pod, "finish"))
            runs = Runs(
                total=data["total"],
                passed=data["passed"],
                failed=data["failed"],
                errored=data["errored"],
                stored=data.get("stored", data["passed"] + data["failed"] + data["errored"]),
            )
        except (ValueError, KeyError, TypeError):
            continue
        return Final(
            runs,
            data.get("failedRuns", ""),
            data.get("erroredRuns", ""),
            bool(data.get("truncated")),
            tuple(data.get("failing") or ())[:10],
        )
    return None


def composed_of(pods: Iterable[Object]) -> tuple[list[int], str] | str | None:
    """Variants by entry and breaks of the compose Job; its message when it failed."""
    error: str | None = None
    for pod in pods:
        message = _message(pod, "compose")
        try:
            data = json.loads(message)
            if "error" in data:
                error = str(data["error"])
            else:
                return [int(number) for number in data["counts"]], data.get("breaks", "")
        except (ValueError, KeyError, TypeError):
            error = error or message or None
    return error


_EVENTS = {
    "FailedMount": "Configuration",
    "FailedCreatePodSandBox": "Container",
    "FailedCreate": "Refused",
}
"""What is told of pods and Jobs by events alone, and the cause for people."""


def trouble_of_events(events: Iterable[Object]) -> Trouble | None:
    """Why a pod is not made or does not begin, as events tell; the last counts."""
    found = None
    for item in events:
        reason = _EVENTS.get(item.get("reason", ""))
        if reason is not None:
            message = item.get("message", "")
            quota = reason == "Refused" and "exceeded quota" in message
            found = Trouble("Quota" if quota else reason, message)
    return found


STUCK_SECONDS = 60.0
TRACKING = "batch.kubernetes.io/job-tracking"


def is_stuck(pod: Object, moment: datetime) -> bool:
    """Whether a deleted pod is held by its Job for long.

    The Job controller lets go of a failed index's pod when it has made the next one. In a namespace
    that is being deleted it cannot, and the namespace waits for its pods before it removes Jobs.
    """
    meta = pod["metadata"]
    deleted = meta.get("deletionTimestamp")
    if deleted is None or TRACKING not in (meta.get("finalizers") or ()):
        return False
    ended = (pod.get("status") or {}).get("phase") in {"Failed", "Succeeded"}
    return ended and parse_time(deleted) + timedelta(seconds=STUCK_SECONDS) < moment


def trouble_of(pods: Iterable[Object]) -> Trouble | None:
    """Why pods do not start or do not end well; the most telling cause of all."""
    found = [trouble for pod in pods for trouble in _troubles(pod)]
    ranked = ("Incompatible", "InvalidDocument", "InvalidPlan", "ImagePull", "Configuration")
    order = {reason: rank for rank, reason in enumerate(ranked)}
    return min(found, key=lambda t: order.get(t.reason, len(order)), default=None)


def _troubles(pod: Object) -> Iterator[Trouble]:
    status: Object = pod.get("status") or {}
    for condition in status.get("conditions") or ():
        if condition["type"] == "PodScheduled" and condition["status"] == "False":
            yield Trouble("Unschedulable", f"no node for the pod: {condition.get('message', '')}")
    for container in _containers(pod):
        waiting = (container.get("state") or {}).get("waiting") or {}
        if waiting.get("reason") in _WAITING:
            yield Trouble(_WAITING[waiting["reason"]], _waiting_message(container, waiting))
        ended = (container.get("state") or {}).get("terminated") or {}
        if ended.get("exitCode") in _EXITS:
            reason = _EXITS[ended["exitCode"]]
            told = _error(ended.get("message") or "")
            message = told or f"{container['name']}: exit {ended['exitCode']}"
            yield Trouble(reason, message, final=reason in _FINAL)


_FINAL = frozenset({"Incompatible", "InvalidDocument", "InvalidPlan"})


def _error(message: str) -> str:
    """What a container says is wrong; those with a report say it as one key of that."""
    try:
        return str(json.loads(message)["error"])
    except (ValueError, KeyError, TypeError):
        return message.strip()


def _waiting_message(container: Object, waiting: Object) -> str:
    name, image = container["name"], container.get("image", "")
    told = waiting.get("message", "")
    if _WAITING[waiting["reason"]] == "ImagePull":
        return (
            f"the image {image} of the container {name} cannot be pulled ({waiting['reason']}): "
            f"{told} Check its name, and `spec.scheduling.imagePullSecrets` for a private one."
        )
    return f"the container {name} cannot start ({waiting['reason']}): {told}"


def _containers(pod: Object) -> Iterator[Object]:
    status = pod.get("status") or {}
    yield from status.get("initContainerStatuses") or ()
    yield from status.get("containerStatuses") or ()


def _message(pod: Object, container: str) -> str:
    for status in _containers(pod):
        if status["name"] == container:
            ended = (status.get("state") or {}).get("terminated") or {}
            return str(ended.get("message") or "")
    return ""


def last_words(pods: Iterable[Object], container: str, indexes: str) -> list[str]:
    """What the last pods of some completion indexes said, by index, each text once.

    Args:
        pods: of one Job.
        container: whose words.
        indexes: as ranges.
    """
    said: dict[int, tuple[str, str]] = {}
    for pod in pods:
        index = int((pod["metadata"].get("annotations") or {}).get(INDEX_ANNOTATION, "-1"))
        words = (pod["metadata"].get("creationTimestamp", ""), _message(pod, container).strip())
        if words[1]:
            said[index] = max(words, said.get(index, words))
    wanted = [i for first, last in parse_ranges(indexes) for i in range(first, last + 1)]
    return list(dict.fromkeys(said[index][1] for index in wanted if index in said))
