"""Reads the status of pods: how containers ended, and why others do not start. Pure functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from signal import SIGKILL, SIGTERM

from robovast.execution.compat import INCOMPATIBLE
from robovast.kubeapi.pod_contract.exit_codes import NEVER_STARTED, VERDICTS, AgentExit
from robovast.kubeapi.pod_contract.messages import error_in
from robovast.kubeapi.pod_contract.pack_request import AGENT, INDEX_ANNOTATION, RUN
from robovast.kubeapi.pod_contract.pod_facts import Sightings
from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import after_colon, sentence
from robovast_operator.kube.times import parse_time
from robovast_operator.kube.untrusted_fields import LARGEST, mapping, mappings, number, ranges, text
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.own import (
    COMPAT,
    blocking,
    containers_of,
    ending_of,
    foreign_names,
    has_verdict,
    is_own,
    lingers,
)

_WAITING = {
    "ImagePullBackOff": "ImagePullFailed",
    "ErrImagePull": "ImagePullFailed",
    "ErrImageNeverPull": "ImagePullFailed",
    "InvalidImageName": "ImagePullFailed",
    "CreateContainerConfigError": "ContainerConfigError",
    "CreateContainerError": "ContainerError",
    "RunContainerError": "ContainerError",
}
"""Reasons that the kubelet gives for a waiting container, and the cause in plain words."""

_EXITS = {
    AgentExit.BAD_PLAN: "InvalidPlan",
    AgentExit.BAD_DOCUMENT: "InvalidDocument",
    AgentExit.OTHER_OWNER: "BucketConflict",
    AgentExit.STORAGE: "StorageUnavailable",
    AgentExit.REFUSED_AT_START: "StorageDenied",
    AgentExit.REFUSED: "StorageDenied",
    INCOMPATIBLE: "IncompatibleImage",
}
"""Exit codes of our containers that are no verdicts."""


STUCK_SECONDS = 60.0
TRACKING = "batch.kubernetes.io/job-tracking"


def is_stuck(pod: Object, moment: datetime) -> bool:
    """Return whether a Job has held back the deletion of a pod for long.

    The Job controller lets go of a failed index's pod when it has made the next one. In a namespace
    that is being deleted it cannot, and the namespace waits for its pods before it removes Jobs.
    """
    meta = pod["metadata"]
    deleted = meta.get("deletionTimestamp")
    if deleted is None or TRACKING not in (meta.get("finalizers") or ()):
        return False
    ended = pod["status"].get("phase") in ("Failed", "Succeeded")
    return ended and parse_time(deleted) + timedelta(seconds=STUCK_SECONDS) < moment


def trouble_of(pods: Iterable[Object]) -> Trouble | None:
    """Return why pods do not start or do not end well: the cause that explains most."""
    return most_telling(trouble for pod in pods for trouble in troubles_of(pod))


def most_telling(troubles: Iterable[Trouble]) -> Trouble | None:
    """Return the cause that explains the others."""
    ranked = (
        *("IncompatibleImage", "InvalidDocument", "InvalidPlan", "BucketConflict"),
        *("StorageDenied", "ImagePullFailed", "ContainerConfigError", "ForeignContainer"),
        *(
            "ContainerError",
            "OutOfMemory",
            "StorageUnavailable",
            "Evicted",
            "PodRejected",
            "NodeLost",
            "NoLogOutput",
        ),
    )
    order = {reason: rank for rank, reason in enumerate(ranked)}
    return min(troubles, key=lambda t: order.get(t.reason, len(order)), default=None)


_ROOM = (
    "Compare the resources of the nodes (`kubectl describe nodes`) with the requests of the pod: "
    "`execution.resources` and `execution.kubernetes` of the .vast file, and `spec.scheduling`."
)


def troubles_of(pod: Object) -> Iterator[Trouble]:
    """Generate the causes that hinder a pod, or have ended the pod."""
    status: Object = pod.get("status") or {}
    ended_by_us = has_verdict(pod) and foreign_names(pod)
    if status.get("phase") == "Failed" and text(status.get("reason")) and not ended_by_us:
        reason = "Evicted" if status["reason"] == "Evicted" else "PodRejected"
        node = text(pod["spec"].get("nodeName"), "?")
        cause = after_colon(text(status.get("message")))
        message = (
            f"Node {node} terminated a pod ({status['reason']}){cause}. "
            f"Inspect the node with `kubectl describe node {node}`."
        )
        yield Trouble(reason, message)
    for condition in status.get("conditions") or ():
        if condition["type"] == "PodScheduled" and condition["status"] == "False":
            cause = after_colon(text(condition.get("message")))
            yield Trouble("Unschedulable", f"No node can run the pod{cause}. {_ROOM}")
    yield from _foreign_troubles(pod)
    foreign = foreign_names(pod)
    for container in containers_of(pod):
        if container["name"] in foreign:
            continue
        waiting = (container.get("state") or {}).get("waiting") or {}
        if waiting.get("reason") in _WAITING:
            yield Trouble(_WAITING[waiting["reason"]], _waiting_message(pod, container, waiting))
        ended = (container.get("state") or {}).get("terminated") or {}
        trouble = _ending(pod, container, ended) if ended else None
        if trouble is not None:
            yield trouble


def _foreign_troubles(pod: Object) -> Iterator[Trouble]:
    """Generate the problems of foreign containers that block a pod or keep a pod alive."""
    for container, how in blocking(pod):
        yield foreign_trouble(pod, container, how)
    if left := lingers(pod):
        effect = ", and keeps the pod alive although the work of the pod is done"
        yield _of_foreign(pod, left[0], effect)


def foreign_trouble(pod: Object, container: str, how: str) -> Trouble:
    """Return the trouble that a container that is not ours keeps runs from starting."""
    return _of_foreign(pod, container, f". The runs cannot start because that container {how}")


def _of_foreign(pod: Object, container: str, effect: str) -> Trouble:
    who = f"The container {container} in the pod {text(pod['metadata'].get('name'))}"
    remedy = (
        "Ask your cluster administrator why this container is added, or exclude the pods of the "
        "campaign by `spec.scheduling.podAnnotations` or `spec.scheduling.podLabels`."
    )
    return Trouble("ForeignContainer", f"{who} is not part of the campaign{effect}. {remedy}")


_ORDINARY = frozenset(
    {
        *VERDICTS,
        *(AgentExit.RUNS_LEFT, 128 + SIGKILL, 128 + SIGTERM),
    }
)
"""Exit codes of our containers that report a verdict, or that they were asked to stop."""


def _ending(pod: Object, container: Object, ended: Object) -> Trouble | None:
    """Return the problem that the end of a container shows; None if the end is a result."""
    name, code = container["name"], ended.get("exitCode")
    error = error_in(ended.get("message") or "")
    if ended.get("reason") in NEVER_STARTED:
        message = f"Container {name} cannot start{after_colon(error)}. {_inspect(pod)}"
        return Trouble("ContainerError", message)
    if not is_own(pod, name):
        return None
    if code in _EXITS:
        reason = _EXITS[code]
        final = reason in _FINAL and (name, code) != (AGENT, AgentExit.REFUSED)
        if not error:
            message = f"Container {name} ended with exit code {code}. {_read_log(pod, name)}"
        else:
            message = sentence(error, f"Container {name} failed: ")
        return Trouble(reason, message, final=final)
    if ended.get("reason") == "OOMKilled":
        message = f"Container {name} needs more than {memory_limit(pod, name)}. {_MORE_MEMORY}"
        return Trouble("OutOfMemory", message)
    if code in _ORDINARY:
        return None
    cause = f"exit code {code}{after_colon(error)}"
    if name == COMPAT:
        message = (
            f"Image {container.get('image', '')} cannot run ({cause}). Check that the image "
            "matches the CPU architecture of the node and contains a shell."
        )
        return Trouble("ContainerError", message)
    return Trouble("ContainerError", f"Container {name} failed ({cause}). {_read_log(pod, name)}")


_MORE_MEMORY = "Raise the limit, or use a node with more memory."


def _inspect(pod: Object) -> str:
    """Return the sentence that names the command to inspect a pod."""
    return f"Inspect the pod with `kubectl describe pod {_named(pod)}`."


def _read_log(pod: Object, container: str) -> str:
    """Return the sentence that names the command to read the log of a container."""
    return f"Read the log with `kubectl logs {_named(pod)} -c {container}`."


def _named(pod: Object) -> str:
    """Return name and namespace of a pod as arguments of `kubectl`."""
    meta = pod["metadata"]
    return f"{text(meta.get('name'))} -n {text(meta.get('namespace'))}"


_FINAL = frozenset(
    {"IncompatibleImage", "InvalidDocument", "InvalidPlan", "BucketConflict", "StorageDenied"}
)


def _waiting_message(pod: Object, container: Object, waiting: Object) -> str:
    name, cause = container["name"], text(waiting.get("message"))
    if _WAITING[waiting["reason"]] == "ImagePullFailed":
        assets = next((image for image in _mounted_images(pod) if f'"{image}"' in cause), None)
        image = (
            f"{assets} of `execution.kubernetes.assets`"
            if assets
            else f"{container.get('image', '')} of {_user_of_image(pod, name)}"
        )
        return (
            f"Cannot pull the image {image} ({waiting['reason']}){after_colon(cause)}. "
            "Check the image name and `spec.scheduling.imagePullSecrets`."
        )
    reason = waiting["reason"]
    return f"Container {name} cannot start ({reason}){after_colon(cause)}. {_inspect(pod)}"


def _user_of_image(pod: Object, container: str) -> str:
    """Name what the image of a container is for."""
    ours = is_own(pod, container) and container != COMPAT
    return "RoboVAST" if ours else "the runs"


def _mounted_images(pod: Object) -> Iterator[str]:
    """Generate images that are mounted as volumes; containers wait for these images."""
    for volume in mappings(pod["spec"].get("volumes")):
        if reference := text(mapping(volume.get("image")).get("reference")):
            yield reference


def message_of(pod: Object, container: str) -> str:
    """Return the termination message of a container."""
    return str(ending_of(pod, container).get("message", ""))


def last_message(pods: Iterable[Object], container: str) -> str:
    """Return the termination message of a container in the latest pod with one; else empty."""
    messages = {p["metadata"]["creationTimestamp"]: message_of(p, container).strip() for p in pods}
    return next((messages[at] for at in sorted(messages, reverse=True) if messages[at]), "")


def memory_limit(pod: Object, container: str) -> str:
    """Name the memory limit of a container of a pod, and the origin of the limit."""
    spec: Object = pod.get("spec") or {}
    found = next((c for c in mappings(spec.get("containers")) if c.get("name") == container), {})
    limit = mapping(mapping(found.get("resources")).get("limits")).get("memory")
    if limit is None:
        return "the memory of the node, because the container has no memory limit"
    note = text(mapping(pod["metadata"].get("annotations")).get("kubernetes.io/limit-ranger"))
    if re.search(rf"memory[^;]* limit for container {re.escape(container)}(;|$)", note):
        origin = "set by a LimitRange of the namespace, because nothing else sets one"
    elif is_own(pod, container):
        origin = "set by `agent.resources` and `agent.taskResources` of the Helm chart"
    else:
        origin = "set by `resources` in the .vast file"
    return f"the memory limit of {limit} ({origin})"


def sighted(pod: Object) -> Sightings:
    """Return the image and the end of a run from the status of a pod."""
    name = text(pod["metadata"].get("name"))
    for container in containers_of(pod):
        if container["name"] == RUN:
            image = text(container.get("imageID")).rpartition("://")[2]
            images = {name: image} if _IMAGE.fullmatch(image) else {}
            killed = ending_of(pod, RUN).get("reason") == "OOMKilled"
            return Sightings(images, frozenset({name} if killed else ()))
    return Sightings()


_IMAGE = re.compile(r"([\w.:/-]{1,400}@)?sha256:[0-9a-f]{64}", re.ASCII)


def index_of(pod: Object) -> int:
    """Return the completion index of a pod; -1 without an index."""
    return number(pod["metadata"].get("annotations", {}).get(INDEX_ANNOTATION), -1)


def last_messages(pods: Iterable[Object], container: str, indexes: str) -> list[str]:
    """Return the last termination message of some completion indexes, by index, each text once.

    Args:
        pods: of one Job.
        container: whose words.
        indexes: as ranges.
    """
    messages: dict[int, tuple[str, str]] = {}
    for pod in pods:
        index = index_of(pod)
        message = (pod["metadata"]["creationTimestamp"], message_of(pod, container).strip())
        if message[1]:
            messages[index] = max(message, messages.get(index, message))
    wanted = ranges(indexes, LARGEST)
    chosen = [i for i in sorted(messages) if any(first <= i <= last for first, last in wanted)]
    return list(dict.fromkeys(messages[index][1] for index in chosen))
