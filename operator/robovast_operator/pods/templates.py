"""The pods of a campaign, as pure functions of it.

A run's pod: `compat-version` first, then our `agent` next to the user's `robovast` container and
its secondaries, which wait until it has prepared the run. Only our own containers see credentials;
no container sees a token.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import replace
from typing import Any

from robovast.agent.scripts import AWAIT, FOLDER, SHELL, START
from robovast.agent.silent_runs import SILENT
from robovast.base.docstrings import WITHOUT
from robovast.common.execution import COMPAT_VERSION
from robovast.execution.compat import COMPAT_SCRIPT
from robovast.execution.contract import CONFIG, OUT
from robovast.kubeapi.notice import NOTICE_VARIABLE, Order
from robovast.kubeapi.pod_contract.mounts import SECRET_MODE, Mount
from robovast.kubeapi.pod_contract.pack_request import AGENT, PackRequest
from robovast.kubeapi.pod_contract.pod_facts import FILE
from robovast.kubeapi.pod_contract.pods import (
    OWN_USER,
    confined,
    confined_pod,
    own_container,
    spread,
)
from robovast.kubeapi.pod_contract.storage_address import address_variables
from robovast.kubeapi.resources import ROLE_LABEL, SHARD_ROLE, UID_LABEL, Scheduling
from robovast.kubeapi.secret_names import may_be_named, refusal
from robovast.model.document.assets import Assets
from robovast.model.document.execution import Nodes, Resources
from robovast.model.expansion.limit import VARIABLE
from robovast.model.quantities import (
    cpus,
    disk,
    gpu_resource,
    gpus,
    memory,
    shared_memory,
)
from robovast_operator.kube.objects import Object
from robovast_operator.planning.campaign import Accepted
from robovast_operator.settings import OperatorSettings

CAMPAIGN = (Mount.PLAN, Mount.FILES, Mount.CREDENTIALS)
"""What our own containers see of a campaign."""

_START = f"{FOLDER}/{START.name}"
_AWAIT_SCRIPT = AWAIT.read_text(encoding="utf-8")

SHM = "/dev/shm"  # noqa: S108

DEADLINE_MARGIN = 3600
"""Beside the runs themselves: pulling images, preparing, storing [s]."""

GRACE_SECONDS = 60
"""Grace period for runs that must stop, and for results that are being stored [s]."""


def run_pod(
    accepted: Accepted, settings: OperatorSettings, plan: str, request: PackRequest, runs: int = 1
) -> Object:
    """Return the pod spec of a pack of runs.

    Args:
        accepted: the campaign.
        settings: of the installation.
        plan: name of the ConfigMap with the plan.
        request: which runs.
        runs: how many of them one start executes at most.
    """
    execution = accepted.vast.execution
    spec = _pod(accepted, settings, plan, execution.kubernetes.jobs)
    spec["initContainers"] = [
        _compat(accepted, settings),
        *_secondaries(accepted, settings),
    ]
    asked = disk(execution.kubernetes.ephemeral_storage, accepted.spec.cluster or "", "")
    if asked is not None:
        settings = replace(settings, work_request=str(asked), work_limit=str(asked))
    spec["containers"] = [
        _agent(accepted, settings, request),
        _run_container(accepted, settings, "robovast", [], execution.resources),
    ]
    if execution.kubernetes.device_claims:
        spec["resourceClaims"] = device_claims(execution.kubernetes.device_claims)
    own = [_work(settings), *_shared_memory(accepted)]
    spec["volumes"] = [*own, *asset_volumes(execution.kubernetes.assets), *spec["volumes"]]
    labels = {UID_LABEL: accepted.identity.uid, ROLE_LABEL: SHARD_ROLE}
    spread_over = spread(accepted.spec.scheduling, labels)
    if spread_over:
        spec["topologySpreadConstraints"] = spread_over
    if execution.timeout is not None:
        longest = (execution.timeout + GRACE_SECONDS) * runs
        spec["activeDeadlineSeconds"] = longest + DEADLINE_MARGIN
    return spec


def task_pod(
    accepted: Accepted,
    settings: OperatorSettings,
    plan: str,
    command: str,
    sightings: Sequence[str] = (),
) -> Object:
    """Return the pod spec of our own work on a whole campaign, such as finish.

    Args:
        accepted: the campaign.
        settings: of the installation.
        plan: name of the ConfigMap with the plan.
        command: of the agent.
        sightings: names of the ConfigMaps with the sightings of pods.
    """
    spec = _pod(accepted, settings, plan, accepted.vast.execution.kubernetes.control)
    # Postprocessing needs all results of the campaign, whose size cannot be determined.
    work = _volume(Mount.WORK, emptyDir={}) if command == "process" else _work(settings)
    more = []
    if sightings:
        more.append(_volume(Mount.PODS, projected={"sources": _kept(sightings)}))
    git = accepted.spec.source.git
    if command in {"compose", "propose"} and git is not None and git.secret_name is not None:
        more.append(Mount.GIT.secret(git.secret_name))
    mounts = [*CAMPAIGN, *(Mount(volume["name"]) for volume in more)]
    address = address_variables(accepted.endpoint, accepted.region)
    spec["containers"] = [
        _own(settings, command, [command], mounts, settings.task_resources, address)
    ]
    spec["volumes"] = [work, *spec["volumes"], *more]
    return spec


def _kept(sightings: Sequence[str]) -> list[Object]:
    """Return ConfigMaps as files; the pod starts also if a ConfigMap is deleted."""
    return [
        {"configMap": {"name": name, "items": [{"key": FILE, "path": name}], "optional": True}}
        for name in sightings
    ]


def notify_pod(settings: OperatorSettings, scheduling: Scheduling, order: Order) -> Object:
    """Return the pod spec that sends a notification, without campaign data and S3 credentials."""
    allowed = settings.secret_names
    if refusal(scheduling, allowed):
        scheduling = scheduling.model_copy(update={"image_pull_secrets": []})
    spec = confined_pod(OWN_USER, GRACE_SECONDS, scheduling, architectures=settings.architectures)
    container = _own(settings, "notify", ["notify"], [Mount.RECEIVERS], settings.agent_resources)
    # Kubernetes makes one dollar of two, and replaces `$(NAME)` where there is such a variable.
    text = order.model_dump_json().replace("$", "$$")
    container["env"].append({"name": NOTICE_VARIABLE, "value": text})
    spec["containers"] = [container]
    sources = _receiver_sources(order, allowed)
    projected = {"sources": sources, "defaultMode": SECRET_MODE}
    spec["volumes"] = [_work(settings), _volume(Mount.RECEIVERS, projected=projected)]
    return spec


def _receiver_sources(order: Order, allowed: Container[str]) -> list[Object]:
    """Return keys of Secrets as files; the notifier itself reports a missing key at once.

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


def _pod(accepted: Accepted, settings: OperatorSettings, plan: str, nodes: Nodes) -> Object:
    """Build the part that all pods of a campaign share."""
    user, scheduling = accepted.vast.execution.run_as_user, accepted.spec.scheduling
    spec = confined_pod(user, GRACE_SECONDS, scheduling, nodes.node_labels, settings.architectures)
    spec["volumes"] = [
        _volume(Mount.PLAN, configMap={"name": plan}),
        _volume(Mount.FILES, projected={"sources": _file_sources(accepted)}),
        Mount.CREDENTIALS.secret(accepted.spec.storage.secret_name),
    ]
    return spec


def _file_sources(accepted: Accepted) -> list[Object]:
    """Return the ConfigMap with the input files; empty if the files are elsewhere."""
    source = accepted.spec.source
    if source.inline is None and source.config_map is None:
        return []
    items = inline_items(accepted)
    if source.config_map is not None:
        items = [item.model_dump() for item in source.config_map.items]
    named = {"items": items} if items else {}
    return [{"configMap": {"name": accepted.identity.files, **named}}]


def inline_items(accepted: Accepted) -> list[Object]:
    """Return which key of the ConfigMap becomes which file."""
    inline = accepted.spec.source.inline
    paths = [*inline.files, *inline.binary_files] if inline is not None else []
    return [{"key": f"file-{index}", "path": path} for index, path in enumerate(paths)]


def _compat(accepted: Accepted, settings: OperatorSettings) -> Object:
    """Refuse an image of another version of the run contract before anything starts."""
    return {
        "name": "compat-version",
        "image": accepted.image,
        "command": ["/bin/sh", "-c", COMPAT_SCRIPT],
        "env": [
            {"name": "EXPECTED", "value": str(COMPAT_VERSION)},
            {"name": "IMAGE", "value": accepted.image},
        ],
        "resources": settings.agent_resources,
        "securityContext": confined(settings.restricted_runs),
        "terminationMessagePolicy": "FallbackToLogsOnError",
    }


def _secondaries(accepted: Accepted, settings: OperatorSettings) -> Iterable[Object]:
    for secondary in accepted.vast.execution.secondary_containers:
        container = _run_container(
            accepted, settings, secondary.name, [secondary.name], secondary.resources
        )
        yield container | {"restartPolicy": "Always"}


def _run_container(
    accepted: Accepted,
    settings: OperatorSettings,
    name: str,
    arguments: list[str],
    resources: Resources,
) -> Object:
    """Return a container of the user's image, which sees only its inputs and its output."""
    return {
        "name": name,
        "image": accepted.image,
        "command": [*SHELL, "-c", _AWAIT_SCRIPT, f"{CONFIG}/{_START}", *arguments],
        "resources": container_resources(accepted, resources) | _devices(accepted),
        "securityContext": confined(settings.restricted_runs),
        "volumeMounts": [
            {"name": str(Mount.WORK), "mountPath": CONFIG, "subPath": "config", "readOnly": True},
            {"name": str(Mount.WORK), "mountPath": OUT, "subPath": "out"},
            *({"name": volume["name"], "mountPath": SHM} for volume in _shared_memory(accepted)),
            *(
                {"name": _assets_name(number), "mountPath": assets.path, "readOnly": True}
                for number, assets in enumerate(accepted.vast.execution.kubernetes.assets)
            ),
        ],
    }


def device_claims(templates: Sequence[str]) -> list[Object]:
    """Return the device claims of a pod, one per ResourceClaimTemplate."""
    return [
        {"name": _claim_name(number), "resourceClaimTemplateName": name}
        for number, name in enumerate(templates)
    ]


def _devices(accepted: Accepted) -> Object:
    """Return the same as resources: all containers of a run share them."""
    claims = range(len(accepted.vast.execution.kubernetes.device_claims))
    return {"claims": [{"name": _claim_name(number)} for number in claims]} if claims else {}


def _claim_name(number: int) -> str:
    return f"device-{number}"


def asset_volumes(assets: Sequence[Assets]) -> list[Object]:
    """Return the volumes of a document's assets.

    A claim is read only here, too, so that the kubelet gives its files to no other group.
    """
    return [{"name": _assets_name(number), **_place(one)} for number, one in enumerate(assets)]


def _place(assets: Assets) -> Object:
    if assets.claim is not None:
        return {"persistentVolumeClaim": {"claimName": assets.claim, "readOnly": True}}
    return {"image": {"reference": assets.image}}


def _assets_name(number: int) -> str:
    return f"assets-{number}"


def _shared_memory(accepted: Accepted) -> list[Object]:
    """Return the volume `/dev/shm` that all containers of a run share; empty if not set.

    What is in it counts to the memory of the container that wrote it.
    """
    resources = accepted.vast.execution.resources
    size = shared_memory(resources.shm_size, resources.memory, accepted.spec.cluster or "")
    if size is None:
        return []
    return [{"name": "shm", "emptyDir": {"medium": "Memory", "sizeLimit": str(size)}}]


def _work(settings: OperatorSettings) -> Object:
    """Return the work volume of a run pod; only a pod that exceeds the limit is evicted."""
    limit = {"sizeLimit": settings.work_limit} if settings.work_limit else {}
    return _volume(Mount.WORK, emptyDir=limit)


def _volume(mount: Mount, **source: Object) -> Object:
    return {"name": str(mount), **source}


def _own(
    settings: OperatorSettings,
    name: str,
    arguments: Sequence[str],
    mounts: Iterable[Mount],
    resources: Object,
    more: Iterable[Object] = (),
) -> Object:
    """Return a container of the agent image, with its pod and node as variables."""
    variables: list[Object] = [
        *more,
        {"name": "POD_NAME", "valueFrom": {"fieldRef": {"fieldPath": "metadata.name"}}},
        {"name": "NODE_NAME", "valueFrom": {"fieldRef": {"fieldPath": "spec.nodeName"}}},
        {"name": VARIABLE, "value": str(settings.variant_limit)},
    ]
    if name not in {"compose", "propose"}:  # which check the document
        variables.append({"name": WITHOUT, "value": "true"})
    return own_container(settings.agent_image, name, arguments, mounts, resources, variables)


def _agent(accepted: Accepted, settings: OperatorSettings, request: PackRequest) -> Object:
    """Return the container that prepares and stores the runs.

    It is not started until they are prepared, and not ready while a run is silent.
    """
    resources = settings.agent_resources
    if settings.work_request:
        requests = {**resources.get("requests", {}), "ephemeral-storage": settings.work_request}
        resources = {**resources, "requests": requests}
    arguments = [AGENT, *request.arguments]
    probes = {"startupProbe": _probe("-e", f"config/{_START}") | _WHILE_PREPARING}
    if settings.silence_minutes:
        arguments += ["--silence", f"{settings.silence_minutes * 60:g}"]
        probes["readinessProbe"] = _probe("!", "-e", SILENT) | _WHILE_RUNNING
    address = address_variables(accepted.endpoint, accepted.region)
    return _own(settings, AGENT, arguments, CAMPAIGN, resources, address) | probes


_WHILE_PREPARING = {"initialDelaySeconds": 3, "periodSeconds": 5, "failureThreshold": 17_280}
"""The first look comes when most are prepared, and the last after a day."""
_WHILE_RUNNING = {"periodSeconds": 60, "failureThreshold": 1}


def _probe(*words: str) -> Object:
    """Return a probe by `test`; the last word is a path in the pod's own volume."""
    command = ["test", *words[:-1], f"{Mount.WORK.path}/{words[-1]}"]
    return {"exec": {"command": command}, "timeoutSeconds": 20}


def container_resources(accepted: Accepted, resources: Resources) -> Object:
    """Return requests and limits of a container; what a document does not limit is not limited.

    Raises:
        InputError: a value is none, or there is none for this cluster.
    """
    context = accepted.spec.cluster or ""
    gpu_name = gpu_resource(accepted.vast.execution.kubernetes.gpu_resource, context)
    amounts: dict[str, Any] = {
        "cpu": _cpu(cpus(resources.cpu, "execution.resources.cpu", context)),
        "memory": memory(resources.memory, "execution.resources.memory", context),
        gpu_name: gpus(resources.gpu, "execution.resources.gpu", context) or None,
    }
    limits = {name: str(value) for name, value in amounts.items() if value is not None}
    return {"requests": limits, "limits": limits} if limits else {}


def _cpu(cores: float | None) -> str | None:
    return None if cores is None else f"{round(cores * 1000)}m"
