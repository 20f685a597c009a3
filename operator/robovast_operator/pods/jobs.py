"""The Jobs and ConfigMaps of a campaign, as pure functions of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from robovast.execution.compat import INCOMPATIBLE
from robovast.kubeapi.notice import Order
from robovast.kubeapi.pod_contract.exit_codes import USELESS, AgentExit
from robovast.kubeapi.pod_contract.mounts import DOCUMENT_FILE, PLAN_FILE
from robovast.kubeapi.pod_contract.pack_request import AGENT, RUN, PackRequest
from robovast.kubeapi.pod_contract.pod_facts import FILE, Sightings
from robovast.kubeapi.pod_contract.pods import failure_policy, on_exit
from robovast.kubeapi.resources import ROLE_LABEL, SHARD_LABEL, SHARD_ROLE, Scheduling
from robovast.kubeapi.share_job import ROLE as SHARE_ROLE
from robovast.kubeapi.share_job import Upload, job_spec, pod_spec
from robovast.model.packs import Bundle, CampaignPlan, Entry, GitSource, PlanSpec
from robovast.model.quantities import cpus, memory
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.store import (
    CONFIGURATION_LABEL,
    NOTIFY_ROLE,
    PRIORITY_LABEL,
    QUEUE_LABEL,
)
from robovast_operator.kube.untrusted_fields import mapping
from robovast_operator.planning.campaign import Accepted
from robovast_operator.planning.shards import ShardPlan
from robovast_operator.pods.templates import inline_items, notify_pod, run_pod, task_pod
from robovast_operator.settings import OperatorSettings

RETRIES_PER_INDEX = 6
"""Number of times that a pack that loses its pod continues after its last stored run."""

TASK_RETRIES = 20
COMPOSE_RETRIES = 5
"""Nothing is lost yet when a document cannot be expanded; after 10 s, 20 s, … another pod tries."""

NOTIFY_RETRIES = 6
"""Retries of one receiver; the Job waits for 10 s, 20 s, … in between."""
NOTIFY_DEADLINE = 1800
"""Deadline of sending [s]."""
NOTIFY_KEEP = 3600
"""How long a notification's Job and its pods are kept for people to read [s]."""

_QUIET = {"argocd.argoproj.io/ignore-resource-updates": "true"}
"""A GitOps tool need not look at an application again for each change of a Job or pod."""

_RUN_IS_MEANT = {"kubectl.kubernetes.io/default-container": RUN}
"""`kubectl logs` and `exec` without a container's name."""


def shard_job(accepted: Accepted, settings: OperatorSettings, shard: ShardPlan) -> Object:
    """Return the Indexed Job of a shard: a completion index for each pack."""
    request = PackRequest(shard.first_pack, attempt=shard.attempt, repeat=shard.repeat or None)
    job = _job(accepted.identity, shard.job, SHARD_ROLE, {SHARD_LABEL: str(shard.index)})
    pod = run_pod(accepted, settings, shard.plan, request, shard.runs_per_pack)
    queue = accepted.spec.queue_name
    job["spec"] |= {
        "completionMode": "Indexed",
        "completions": shard.size,
        "parallelism": shard.parallelism,
        "backoffLimitPerIndex": RETRIES_PER_INDEX,
        "maxFailedIndexes": shard.size,
        "suspend": queue is not None or accepted.spec.suspend,
        **failure_policy(
            "FailIndex",
            AGENT,
            on_exit("FailJob", "compat-version", [INCOMPATIBLE]),
            on_exit("FailJob", AGENT, {*USELESS} - {AgentExit.REFUSED}),
            on_exit("FailIndex", AGENT, [AgentExit.FAILED, AgentExit.ERRORED, AgentExit.REFUSED]),
            on_exit("Ignore", AGENT, [AgentExit.STORAGE]),  # it costs time, no tries
        ),
    }
    job["spec"]["template"]["spec"] = pod
    job["spec"]["template"]["metadata"]["annotations"] = {**_QUIET, **_RUN_IS_MEANT}
    if queue is not None:
        job["metadata"]["labels"][QUEUE_LABEL] = queue
    if accepted.spec.queue_priority_class_name is not None:
        job["metadata"]["labels"][PRIORITY_LABEL] = accepted.spec.queue_priority_class_name
    if shard.owner is not None:
        job["metadata"]["labels"][CONFIGURATION_LABEL] = shard.owner["uid"]
    return _with_metadata(job, accepted.spec.scheduling)


def _with_metadata(job: Object, scheduling: Scheduling) -> Object:
    """Add the annotations and labels of a campaign's pods to a Job; ours take precedence."""
    metadata = job["spec"]["template"]["metadata"]
    metadata["labels"] = {**scheduling.pod_labels, **metadata["labels"]}
    metadata["annotations"] = {**scheduling.pod_annotations, **metadata["annotations"]}
    return job


def task_job(
    accepted: Accepted,
    settings: OperatorSettings,
    command: str,
    name: str,
    plan: str,
    sightings: Sequence[str] = (),
) -> Object:
    """Return the Job of a task on the whole campaign: compose, propose, finish, process, purge."""
    job = _job(accepted.identity, name, command, {})
    job["spec"] |= {
        "backoffLimit": COMPOSE_RETRIES if command == "compose" else TASK_RETRIES,
        **failure_policy(
            "FailJob",
            command,
            on_exit("FailJob", command, USELESS),
            on_exit("Ignore", command, [AgentExit.STORAGE]),
        ),
    }
    job["spec"]["template"]["spec"] = task_pod(accepted, settings, plan, command, sightings)
    return _with_metadata(job, accepted.spec.scheduling)


def notify_job(
    identity: Identity, settings: OperatorSettings, scheduling: Scheduling, name: str, order: Order
) -> Object:
    """Return the Job that sends a notice: a completion index for each receiver."""
    job = _job(identity, name, NOTIFY_ROLE, {})
    number = len(order.receivers)
    job["spec"] |= {
        "completionMode": "Indexed",
        "completions": number,
        "parallelism": number,
        "backoffLimitPerIndex": NOTIFY_RETRIES,
        "activeDeadlineSeconds": NOTIFY_DEADLINE,
        "ttlSecondsAfterFinished": NOTIFY_KEEP,
        **failure_policy(
            "FailIndex",
            NOTIFY_ROLE,
            on_exit("FailIndex", NOTIFY_ROLE, [AgentExit.BAD_PLAN, AgentExit.BAD_DOCUMENT]),
        ),
    }
    job["spec"]["template"]["spec"] = notify_pod(settings, scheduling, order)
    return _with_metadata(job, scheduling)


def upload_job(accepted: Accepted, settings: OperatorSettings, name: str, archive: str) -> Object:
    """Return the Job that uploads a campaign's results.

    Args:
        accepted: the campaign; it has a share.
        settings: of the installation.
        name: of the Job.
        archive: what the results are called on the share.
    """
    spec, identity = accepted.spec, accepted.identity
    assert spec.share is not None  # noqa: S101  # the caller looked
    upload = Upload(
        campaign=archive,
        bucket=accepted.bucket,
        endpoint=accepted.endpoint,
        image=settings.agent_image,
        region=accepted.region,
        secret=spec.storage.secret_name,
        owner={"metadata": {"uid": identity.uid}},
        scheduling=spec.scheduling,
    )
    job = _job(identity, name, SHARE_ROLE, {})
    job["spec"] |= job_spec()
    job["spec"]["template"]["spec"] = pod_spec(upload, spec.share.secret_name)
    return _with_metadata(job, accepted.spec.scheduling)


def _job(identity: Identity, name: str, role: str, labels: dict[str, str]) -> Object:
    own = {**identity.labels, ROLE_LABEL: role, **labels}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {
            "name": name,
            "namespace": identity.namespace,
            "labels": dict(own),
            "annotations": _QUIET,
            "ownerReferences": [identity.owner],
        },
        "spec": {"template": {"metadata": {"labels": dict(own), "annotations": _QUIET}}},
    }


def plan_config_map(accepted: Accepted, name: str, plan: CampaignPlan) -> Object:
    """Return the immutable ConfigMap with the plan, for the campaign's pods."""
    data = {
        PLAN_FILE: plan.model_dump_json(exclude_none=True),
        DOCUMENT_FILE: accepted.document_text,
    }
    return _config_map(accepted.identity, name, {"data": data})


def _config_map(identity: Identity, name: str, content: Object, role: str = "") -> Object:
    """Return an immutable ConfigMap of a campaign."""
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {
            "name": name,
            "namespace": identity.namespace,
            "labels": identity.labels | ({ROLE_LABEL: role} if role else {}),
            "ownerReferences": [identity.owner],
        },
        "immutable": True,
        **content,
    }


SIGHTINGS_ROLE = "pods"
"""Role of ConfigMaps with the sightings of a Job's pods."""


def sightings_config_map(identity: Identity, job: str, seen: Sightings) -> Object:
    """Return the immutable ConfigMap with the sightings of a Job's pods.

    Args:
        identity: of the Campaign.
        job: uid of the Job, because a Job that is created again has other pods.
        seen: what was seen.
    """
    data = {FILE: seen.dump()}
    return _config_map(identity, identity.child(f"pods-{job}"), {"data": data}, SIGHTINGS_ROLE)


def files_config_map(accepted: Accepted, source: Object | None) -> Object | None:
    """Return the immutable ConfigMap with a Campaign's input files; None without files.

    Args:
        accepted: the campaign.
        source: the ConfigMap that they come from, if they come from one.
    """
    if source is not None:
        content = _copied(source, accepted)
    elif accepted.spec.source.inline is not None:
        content = _inline(accepted)
    else:
        return None
    return _config_map(accepted.identity, accepted.identity.files, content)


def _inline(accepted: Accepted) -> Object:
    inline = accepted.spec.source.inline
    keys = {item["path"]: item["key"] for item in inline_items(accepted)}
    texts = inline.files if inline is not None else {}
    data = inline.binary_files if inline is not None else {}
    return {
        "data": {keys[path]: text for path, text in texts.items()},
        "binaryData": {keys[path]: content for path, content in data.items()},
    }


def _copied(source: Object, accepted: Accepted) -> Object:
    """Return the keys of a ConfigMap that the campaign wants."""
    given = accepted.spec.source.config_map
    wanted = {item.key for item in given.items} if given is not None else set()
    kinds = {kind: mapping(source.get(kind)) for kind in ("data", "binaryData")}
    return {
        kind: {key: value for key, value in found.items() if not wanted or key in wanted}
        for kind, found in kinds.items()
    }


def campaign_plan(
    accepted: Accepted, plan: PlanSpec | None, entries: tuple[Entry, ...]
) -> CampaignPlan:
    """Return the plan that pods read."""
    execution, spec = accepted.vast.execution, accepted.spec
    context = spec.cluster or ""
    bundle, git = spec.source.bundle, spec.source.git
    made: Literal["composed", "proposed"] = "proposed" if accepted.is_search else "composed"
    return CampaignPlan(
        campaign=accepted.campaign,
        bucket=accepted.bucket,
        owner=accepted.owner,
        document=accepted.document_name,
        expansion="pure" if accepted.pure else made,
        bundle=bundle
        and Bundle(bucket=bundle.bucket or BUNDLES_BUCKET, key=bundle.key, sha256=bundle.sha256),
        git=git and GitSource(url=git.url, ref=git.ref, path=git.path),
        select=tuple(spec.select),
        reuse=spec.reuse,
        runs=accepted.runs,
        seed=accepted.seed,
        image=accepted.image,
        cluster=spec.cluster,
        cpus=cpus(execution.resources.cpu, "execution.resources.cpu", context),
        memory=memory(execution.resources.memory, "execution.resources.memory", context),
        options=spec.options,
        entries=entries,
        inputs=dict(accepted.inputs),
        composed=accepted.composed,
        plan=plan,
    )
