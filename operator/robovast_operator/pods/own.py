"""Judges pods by our own containers: admission may add others, such as a mesh's. Pure functions."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from datetime import datetime, timedelta

from robovast.kubeapi.pod_contract.exit_codes import VERDICTS
from robovast.kubeapi.pod_contract.pack_request import AGENT, FETCH
from robovast.kubeapi.resources import ROLE_LABEL, SHARD_ROLE
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import parse_time
from robovast_operator.kube.untrusted_fields import mapping, mappings, number, text, time

CONTAINERS_ANNOTATION = "robovast.io/containers"
"""Annotation of a pod: the names of its containers as we asked for them."""

COMPAT = "compat-version"
"""Name of our container that checks the image of the runs."""

OWN = frozenset(
    {AGENT, COMPAT, FETCH, "compose", "propose", "finish", "process", "purge", "notify", "share"}
)
"""Names of our own containers in all kinds of pods."""

LEAVE = timedelta(seconds=10)
"""How long other containers may continue after our container has ended."""


def naming_containers(job: Object) -> Object:
    """Return a Job whose pods name the containers that we asked for."""
    named = deepcopy(job)
    template = named["spec"]["template"]
    annotations = template.setdefault("metadata", {}).setdefault("annotations", {})
    annotations[CONTAINERS_ANNOTATION] = " ".join(_names(template["spec"]))
    return named


def container_specs(spec: Object) -> list[Object]:
    """Return the containers that a pod spec asks for, in the order in which they start."""
    return [*mappings(spec.get("initContainers")), *mappings(spec.get("containers"))]


def _names(spec: Object) -> list[str]:
    return [text(container.get("name")) for container in container_specs(spec)]


def foreign_names(pod: Object) -> list[str]:
    """Return the names of a pod's containers that are not ours, in the order of the pod."""
    asked = mapping(pod["metadata"].get("annotations")).get(CONTAINERS_ANNOTATION)
    if not isinstance(asked, str):
        return []
    return [name for name in _names(mapping(pod.get("spec"))) if name not in asked.split()]


def containers_of(pod: Object) -> Iterator[Object]:
    """Generate the statuses of a pod's containers, in their order."""
    status = pod.get("status") or {}
    yield from status.get("initContainerStatuses") or ()
    yield from status.get("containerStatuses") or ()


def main_container(pod: Object) -> str:
    """Return the name of our container whose end is the end of the pod's work.

    A run's other containers and those that admission adds have names that we do not choose.
    """
    role = text(mapping(pod["metadata"].get("labels")).get(ROLE_LABEL))
    return AGENT if role in {SHARD_ROLE, ""} else role


def is_own(pod: Object, container: str) -> bool:
    """Return whether a container of a pod is ours, so that its end is not a result of a run."""
    return container in {main_container(pod), COMPAT, FETCH}


def ending_of(pod: Object, container: str) -> Object:
    """Return the terminated state of a container; empty if the container has not ended."""
    for status in containers_of(pod):
        if status["name"] == container:
            return mapping(mapping(status.get("state")).get("terminated"))
    return {}


def main_ending(pod: Object) -> Object:
    """Return the terminated state of the main container; empty if the container has not ended."""
    return ending_of(pod, main_container(pod))


def has_verdict(pod: Object) -> bool:
    """Return whether our container has done all of the pod's work, whatever others do."""
    return number(main_ending(pod).get("exitCode"), -1) in VERDICTS


def is_alive(pod: Object) -> bool:
    """Return whether the API server counts a pod as open."""
    gone = "deletionTimestamp" in pod["metadata"]
    return not gone and pod["status"].get("phase") not in ("Failed", "Succeeded")


def is_at_work(pod: Object) -> bool:
    """Return whether the agent of a pod has started its runs and has not ended."""
    agent: Object = next((c for c in containers_of(pod) if c["name"] == AGENT), {})
    running = bool(mapping(agent.get("state")).get("running"))
    return is_alive(pod) and running and agent.get("started") is not False


def lingers(pod: Object) -> list[str]:
    """Return the names of foreign containers that keep a pod alive after our container ended."""
    if not (is_alive(pod) and main_ending(pod)):
        return []
    foreign = foreign_names(pod)
    states = {c["name"]: mapping(c.get("state")) for c in containers_of(pod)}
    return [name for name in foreign if "terminated" not in states.get(name, {})]


def is_to_be_ended(pod: Object, moment: datetime) -> bool:
    """Return whether foreign containers have kept a pod alive for too long."""
    due = mapping(pod.get("spec")).get("activeDeadlineSeconds") != 1
    ended = parse_time(time(main_ending(pod).get("finishedAt")))
    return due and bool(lingers(pod)) and ended + LEAVE <= moment


def blocking(pod: Object) -> Iterator[tuple[str, str]]:
    """Return the foreign containers that keep our containers from starting, and how."""
    foreign = set(foreign_names(pod))
    native = {
        text(c.get("name"))
        for c in mappings(mapping(pod.get("spec")).get("initContainers"))
        if c.get("restartPolicy") == "Always"
    }
    for status in mappings(mapping(pod.get("status")).get("initContainerStatuses")):
        name, state = text(status.get("name")), mapping(status.get("state"))
        if name not in foreign or has_verdict(pod):
            continue
        if code := number(mapping(state.get("terminated")).get("exitCode")):
            yield name, f"failed with exit code {code}"
        elif waiting := text(mapping(state.get("waiting")).get("reason")):
            if waiting != "PodInitializing":
                yield name, f"cannot start ({waiting})"
        elif state.get("running") and not (name in native and status.get("started")):
            yield name, "has not finished its start"
