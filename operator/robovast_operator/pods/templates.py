"""The pods of a campaign, as pure functions of it.

A run's pod: `compat-version` and `fetch` before, then the user's `robovast` container and its
secondaries beside our `agent`. Only our own containers see credentials; nobody sees a token.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any

from robovast.agent.silence import SILENT
from robovast.common.execution import COMPAT_VERSION
from robovast.execution.compat import COMPAT_SCRIPT
from robovast.kubeapi.notice import NOTICE_VARIABLE, Order
from robovast.kubeapi.resources import Scheduling
from robovast.kubeapi.secret_names import may_be_named, refusal
from robovast.kubeapi.sightings import FILE
from robovast.model.document.model import Nodes, Resources
from robovast.model.expansion.limit import VARIABLE
from robovast.model.quantities import cpus, memory, resolve_per_context
from robovast_operator.kube.objects import Object
from robovast_operator.planning.campaign import Accepted
from robovast_operator.settings import Settings

WORK: Object = {"name": "work", "mountPath": "/robovast/work"}
PLAN: Object = {"name": "plan", "mountPath": "/robovast/plan", "readOnly": True}
FILES: Object = {"name": "files", "mountPath": "/robovast/files", "readOnly": True}
CREDENTIALS: Object = {
    "name": "credentials",
    "mountPath": "/robovast/credentials",
    "readOnly": True,
}

GIT: Object = {"name": "git", "mountPath": "/robovast/git", "readOnly": True}

SIGHTINGS: Object = {"name": "pods", "mountPath": "/robovast/pods", "readOnly": True}

RECEIVERS: Object = {"name": "receivers", "mountPath": "/robovast/receivers", "readOnly": True}

UNLIMITED: Object = {"name": "work", "emptyDir": {}}

OWN_RESOURCES: Object = {
    "requests": {"cpu": "10m", "memory": "64Mi"},
    "limits": {"memory": "512Mi"},
}
"""Of our own containers beside a run; a request of CPU as small as can be, since it idles.

None has a limit of ephemeral storage: those of a pod's containers are added up, and its volumes
count, so that a small limit here would be one for what the run writes.
"""

TASK_RESOURCES: Object = {
    "requests": {"cpu": "100m", "memory": "256Mi"},
    "limits": {"memory": "2Gi"},
}
"""Of our own containers that work on a whole campaign."""

DEADLINE_MARGIN = 3600
"""Beside the runs themselves: pulling images, fetching, storing [s]."""

OWN_USER = 1000
"""Of our own containers where no run's files are at hand."""

GRACE_SECONDS = 60
"""For runs that are told to end, and for what is just being stored."""


def run_pod(
    accepted: Accepted, settings: Settings, plan: str, fetch_arguments: Sequence[str]
) -> Object:
    """The pod spec of a pack of runs.

    Args:
        accepted: the campaign.
        settings: of the installation.
        plan: name of the ConfigMap with the plan.
        fetch_arguments: which runs, as the command `fetch` takes them.
    """
    execution = accepted.vast.execution
    spec = _pod(accepted, plan, execution.kubernetes.jobs)
    mine = [WORK, PLAN, FILES, CREDENTIALS]
    spec["initContainers"] = [
        _compat(accepted, settings),
        _own(settings, "fetch", ["fetch", *fetch_arguments], mine),
        *_secondaries(accepted, settings),
    ]
    spec["containers"] = [
        _run_container(accepted, settings, "robovast", [], execution.resources),
        _agent(settings, mine),
    ]
    spec["volumes"] = [_work(settings), *spec["volumes"]]
    if execution.timeout is not None:
        longest = (execution.timeout + GRACE_SECONDS) * execution.runs_per_job
        spec["activeDeadlineSeconds"] = longest + DEADLINE_MARGIN
    return spec


def task_pod(
    accepted: Accepted,
    settings: Settings,
    plan: str,
    command: str,
    sightings: Sequence[str] = (),
) -> Object:
    """The pod spec of our own work on a whole campaign: compose, finish, process or purge.

    Args:
        accepted: the campaign.
        settings: of the installation.
        plan: name of the ConfigMap with the plan.
        command: of the agent.
        sightings: names of the ConfigMaps that say what was seen of pods.
    """
    spec = _pod(accepted, plan, accepted.vast.execution.kubernetes.control)
    container = _own(settings, command, [command], [WORK, PLAN, FILES, CREDENTIALS])
    spec["containers"] = [container | {"resources": TASK_RESOURCES}]
    # Results that are worked up are all of the campaign, which nobody knows the size of.
    work = UNLIMITED if command == "process" else _work(settings)
    spec["volumes"] = [work, *spec["volumes"]]
    if sightings:
        container["volumeMounts"].append(SIGHTINGS)
        spec["volumes"].append({"name": "pods", "projected": {"sources": _kept(sightings)}})
    git = accepted.spec.source.git
    if command == "compose" and git is not None and git.secret_name is not None:
        container["volumeMounts"].append(GIT)
        secret = {"secretName": git.secret_name, "defaultMode": 0o440}
        spec["volumes"].append({"name": "git", "secret": secret})
    return spec


def _kept(sightings: Sequence[str]) -> list[Object]:
    """ConfigMaps as files; one that is gone by then keeps nothing from being done."""
    return [
        {"configMap": {"name": name, "items": [{"key": FILE, "path": name}], "optional": True}}
        for name in sightings
    ]


def notify_pod(settings: Settings, scheduling: Scheduling, order: Order) -> Object:
    """The pod spec that sends a notice; it sees nothing of the campaign, and no S3 credentials."""
    allowed = settings.secret_names
    if refusal(scheduling, allowed):
        scheduling = scheduling.model_copy(update={"image_pull_secrets": []})
    spec = _confined_pod(OWN_USER, scheduling, {})
    container = _own(settings, "notify", ["notify"], [WORK, RECEIVERS])
    container["env"].append({"name": NOTICE_VARIABLE, "value": order.model_dump_json()})
    spec["containers"] = [container]
    sources = _receiver_sources(order, allowed)
    projected = {"sources": sources, "defaultMode": 0o440}
    spec["volumes"] = [
        _work(settings),
        {"name": "receivers", "projected": projected},
    ]
    return spec


def _receiver_sources(order: Order, allowed: Container[str]) -> list[Object]:
    """Keys of Secrets as files; one that is missing is told by who looks for it, at once.

    So is one that the Campaign may not name: it is not mounted.
    """
    wanted = [
        (secret, f"{index}/{file}")
        for index, receiver in enumerate(order.receivers)
        for secret, file in ((receiver.url_from, "url"), (receiver.token_from, "token"))
        if secret is not None and may_be_named(secret.name, allowed)
    ]
    return [
        {
            "secret": {
                "name": secret.name,
                "items": [{"key": secret.key, "path": path}],
                "optional": True,
            }
        }
        for secret, path in wanted
    ]


def _pod(accepted: Accepted, plan: str, nodes: Nodes) -> Object:
    """What all pods of a campaign share."""
    user = accepted.vast.execution.run_as_user
    spec = _confined_pod(user, accepted.spec.scheduling, nodes.node_labels)
    spec["volumes"] = [
        {"name": "plan", "configMap": {"name": plan}},
        {"name": "files", "projected": {"sources": _file_sources(accepted)}},
        {
            "name": "credentials",
            "secret": {"secretName": accepted.spec.storage.secret_name, "defaultMode": 0o440},
        },
    ]
    return spec


def _confined_pod(user: int, scheduling: Scheduling, node_labels: Mapping[str, str]) -> Object:
    """A pod without a token, on the nodes that it may be on."""
    spec: Object = {
        "restartPolicy": "Never",
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "terminationGracePeriodSeconds": GRACE_SECONDS,
        "securityContext": {
            "runAsUser": user,
            "runAsGroup": user,
            "fsGroup": user,
            "runAsNonRoot": user != 0,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
    }
    given = scheduling.model_dump(by_alias=True, exclude_none=True)
    selector = {**node_labels, **given.pop("nodeSelector")}
    spec |= {name: value for name, value in given.items() if value}
    return spec | ({"nodeSelector": selector} if selector else {})


def _file_sources(accepted: Accepted) -> list[Object]:
    """Our own ConfigMap with the input files, if they are in one."""
    source = accepted.spec.source
    if source.inline is None and source.config_map is None:
        return []
    items = inline_items(accepted)
    if source.config_map is not None:
        items = [item.model_dump() for item in source.config_map.items]
    named = {"items": items} if items else {}
    return [{"configMap": {"name": accepted.identity.files, **named}}]


def inline_items(accepted: Accepted) -> list[Object]:
    """Which key of the ConfigMap becomes which file."""
    inline = accepted.spec.source.inline
    paths = [*inline.files, *inline.binary_files] if inline is not None else []
    return [{"key": f"file-{index}", "path": path} for index, path in enumerate(paths)]


def _compat(accepted: Accepted, settings: Settings) -> Object:
    """Refuse an image of another version of the run contract before anything starts."""
    return {
        "name": "compat-version",
        "image": accepted.image,
        "command": ["/bin/sh", "-c", COMPAT_SCRIPT],
        "env": [
            {"name": "EXPECTED", "value": str(COMPAT_VERSION)},
            {"name": "IMAGE", "value": accepted.image},
        ],
        "resources": {
            "requests": {"cpu": "10m", "memory": "16Mi"},
            "limits": {"memory": "128Mi"},
        },
        "securityContext": _confined(settings.restricted_runs),
        "terminationMessagePolicy": "FallbackToLogsOnError",
    }


def _secondaries(accepted: Accepted, settings: Settings) -> Iterable[Object]:
    for secondary in accepted.vast.execution.secondary_containers:
        container = _run_container(
            accepted, settings, secondary.name, [secondary.name], secondary.resources
        )
        yield container | {"restartPolicy": "Always"}


def _run_container(
    accepted: Accepted,
    settings: Settings,
    name: str,
    arguments: list[str],
    resources: Resources,
) -> Object:
    """A container of the user's image: it sees its inputs and its own output, nothing else."""
    return {
        "name": name,
        "image": accepted.image,
        "command": ["bash", "/config/start.sh", *arguments],
        "resources": container_resources(resources, accepted.spec.cluster or ""),
        "securityContext": _confined(settings.restricted_runs),
        "volumeMounts": [
            {"name": "work", "mountPath": "/config", "subPath": "config", "readOnly": True},
            {"name": "work", "mountPath": "/out", "subPath": "out"},
        ],
    }


def _work(settings: Settings) -> Object:
    """The volume of a run's pod; what outgrows it ends its own pod, not those beside it."""
    limit = {"sizeLimit": settings.work_limit} if settings.work_limit else {}
    return {"name": "work", "emptyDir": limit}


def _own(settings: Settings, name: str, arguments: list[str], mounts: list[Object]) -> Object:
    """A container of our own image."""
    return {
        "name": name,
        "image": settings.agent_image,
        "command": ["python", "-m", "robovast.agent", *arguments],
        "resources": OWN_RESOURCES,
        "securityContext": _confined(restricted=True) | {"readOnlyRootFilesystem": True},
        "env": [
            {"name": "HOME", "value": WORK["mountPath"]},
            {"name": "TMPDIR", "value": WORK["mountPath"]},
            {"name": "POD_NAME", "valueFrom": {"fieldRef": {"fieldPath": "metadata.name"}}},
            {"name": "NODE_NAME", "valueFrom": {"fieldRef": {"fieldPath": "spec.nodeName"}}},
            {"name": VARIABLE, "value": str(settings.variant_limit)},
        ],
        "terminationMessagePolicy": "FallbackToLogsOnError",
        "volumeMounts": mounts,
    }


def _agent(settings: Settings, mounts: list[Object]) -> Object:
    """What stores the runs; its pod is not ready while a run writes nothing to its log."""
    requests = {**OWN_RESOURCES["requests"]}
    if settings.work_request:
        requests["ephemeral-storage"] = settings.work_request
    resources = {"resources": {**OWN_RESOURCES, "requests": requests}}
    if not settings.silence_minutes:
        return _own(settings, "agent", ["agent"], mounts) | resources
    arguments = ["agent", "--silence", f"{settings.silence_minutes * 60:g}"]
    marker = f"{WORK['mountPath']}/{SILENT}"
    return _own(settings, "agent", arguments, mounts) | {
        **resources,
        "readinessProbe": {
            "exec": {"command": ["test", "!", "-e", marker]},
            "periodSeconds": 60,
            "timeoutSeconds": 20,
            "failureThreshold": 1,
        },
    }


def _confined(restricted: bool) -> Object:
    if not restricted:
        return {}
    return {"allowPrivilegeEscalation": False, "capabilities": {"drop": ["ALL"]}}


def container_resources(resources: Resources, context: str) -> Object:
    """Requests and limits of a container; what a document does not limit is not limited.

    Raises:
        InputError: a value is none, or there is none for this cluster.
    """
    gpu = resolve_per_context(resources.gpu, context, "execution.resources.gpu")
    amounts: dict[str, Any] = {
        "cpu": _cpu(cpus(resources.cpu, "execution.resources.cpu", context)),
        "memory": memory(resources.memory, "execution.resources.memory", context),
        "nvidia.com/gpu": gpu or None,
    }
    limits = {name: str(value) for name, value in amounts.items() if value is not None}
    return {"requests": limits, "limits": limits} if limits else {}


def _cpu(cores: float | None) -> str | None:
    return None if cores is None else f"{round(cores * 1000)}m"
