"""Read the state of a run from its pod (pure functions)."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.base.errors import InputError
from robovast.kubeapi.pod_contract.exit_codes import NEVER_STARTED
from robovast.kubeapi.pod_contract.pack_request import AGENT, FETCH
from robovast_cli.kube.api import Json


def is_live(pod: Json) -> bool:
    """Return whether a pod is not deleted, and its agent has not ended."""
    deleted = pod["metadata"].get("deletionTimestamp")
    alive = (pod.get("status") or {}).get("phase") in (None, "Pending", "Running")
    agents = (s.get("state") or {} for s in _statuses(pod) if s["name"] == AGENT)
    return not deleted and alive and not any("terminated" in state for state in agents)


def has_started(pod: Json, container: str) -> bool:
    """Return whether a container has a log."""
    states = (s.get("state") or {} for s in _statuses(pod) if s["name"] == container)
    return any("running" in state or _has_ended(state) for state in states)


def _has_ended(state: Json) -> bool:
    """Return whether a container was started and has ended."""
    return "terminated" in state and state["terminated"].get("reason") not in NEVER_STARTED


def is_prepared(pod: Json) -> bool:
    """Whether its containers no longer wait for the agent; those of earlier versions never do."""
    agent = next((s for s in _statuses(pod) if s["name"] == AGENT), {})
    return agent.get("started") is not False or "terminated" in (agent.get("state") or {})


def check_container(pod: Json, name: str) -> None:
    """Raise an InputError if a pod has no container of this name."""
    kinds = (pod["spec"].get(kind) or () for kind in ("initContainers", "containers"))
    names = [container["name"] for kind in kinds for container in kind]
    if name not in names:
        raise InputError(
            f"the pod {pod['metadata']['name']} has no container `{name}`; it has "
            f"{', '.join(names)}.",
            hint="name one of them",
        )


def waiting_reason(pod: Json) -> str:
    """Return the reason why the runs of a pod have not started."""
    name = pod["metadata"]["name"]
    return f"its pod {name} {next(_reasons(pod), 'is starting')}"


def running_since(pod: Json, container: str) -> str:
    """Return the start time of a running container as Kubernetes writes it, else an empty text."""
    states = (s.get("state") or {} for s in _statuses(pod) if s["name"] == container)
    return next((str(s["running"]["startedAt"]) for s in states if s.get("running")), "")


def _reasons(pod: Json) -> Iterator[str]:
    for condition in (pod.get("status") or {}).get("conditions") or ():
        if condition["type"] == "PodScheduled" and condition["status"] == "False":
            yield f"is not scheduled: {condition.get('message') or condition.get('reason')}"
    for container in _statuses(pod):
        state = container.get("state") or {}
        waiting = state.get("waiting") or {}
        if waiting.get("message"):
            cause = f"{waiting.get('reason')}: {waiting['message']}"
            yield f"waits for container {container['name']}: {cause}"
        if "terminated" in state and not _has_ended(state):
            cause = state["terminated"].get("message", "")
            yield f"cannot start container {container['name']}: {cause}"
    for container in _statuses(pod):
        running = "running" in (container.get("state") or {})
        if running and container["name"] in ("compat-version", FETCH, AGENT):
            yield f"is being prepared by container {container['name']}"
    spec = (pod.get("spec") or {}).get("initContainers") or ()
    sidecars = {c["name"] for c in spec if c.get("restartPolicy") == "Always"}
    for container in (pod.get("status") or {}).get("initContainerStatuses") or ():
        ready = container["name"] in sidecars and container.get("started")
        if "running" in (container.get("state") or {}) and not ready:
            yield f"waits for container {container['name']}"


def _statuses(pod: Json) -> Iterator[Json]:
    status = pod.get("status") or {}
    yield from status.get("initContainerStatuses") or ()
    yield from status.get("containerStatuses") or ()
