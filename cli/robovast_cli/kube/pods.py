"""Read the state of a run from its pod. Pure functions."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.base.errors import InputError
from robovast.kubeapi.pod_contract.exit_codes import NEVER_STARTED
from robovast.kubeapi.pod_contract.pack_request import AGENT, FETCH
from robovast_cli.kube.api import Json


def is_live(pod: Json) -> bool:
    """Whether a pod exists to execute its runs: not if only containers of others still run."""
    going = pod["metadata"].get("deletionTimestamp")
    alive = (pod.get("status") or {}).get("phase") in (None, "Pending", "Running")
    agents = (s.get("state") or {} for s in _statuses(pod) if s["name"] == AGENT)
    return not going and alive and not any("terminated" in state for state in agents)


def has_begun(pod: Json, container: str) -> bool:
    """Whether a container has a log."""
    states = (s.get("state") or {} for s in _statuses(pod) if s["name"] == container)
    return any("running" in state or _has_ended(state) for state in states)


def _has_ended(state: Json) -> bool:
    """Whether a container has ended that was started before."""
    return "terminated" in state and state["terminated"].get("reason") not in NEVER_STARTED


def is_prepared(pod: Json) -> bool:
    """Whether its containers no longer wait for the agent; those of earlier versions never do."""
    agent = next((s for s in _statuses(pod) if s["name"] == AGENT), {})
    return agent.get("started") is not False or "terminated" in (agent.get("state") or {})


def check_container(pod: Json, name: str) -> None:
    """Make sure that a pod has a container.

    Raises:
        InputError: it has none of this name.
    """
    kinds = (pod["spec"].get(kind) or () for kind in ("initContainers", "containers"))
    names = [container["name"] for kind in kinds for container in kind]
    if name not in names:
        raise InputError(
            f"the pod {pod['metadata']['name']} has no container `{name}`; it has "
            f"{', '.join(names)}.",
            hint="name one of them",
        )


def waiting_reason(pod: Json) -> str:
    """Why the runs of a pod have not begun, as Kubernetes says."""
    name = pod["metadata"]["name"]
    return f"its pod {name} {next(_reasons(pod), 'is starting')}"


def running_since(pod: Json, container: str) -> str:
    """When a container was started, as Kubernetes writes times; empty when it does not run."""
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
            told = f"{waiting.get('reason')}: {waiting['message']}"
            yield f"waits for container {container['name']}: {told}"
        if "terminated" in state and not _has_ended(state):
            told = state["terminated"].get("message", "")
            yield f"cannot start container {container['name']}: {told}"
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
