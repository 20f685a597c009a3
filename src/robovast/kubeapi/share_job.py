"""The Job that uploads a campaign to a share, and the Secret that describes the share."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.file_errors import read_text
from robovast.base.plugins import split_file_reference
from robovast.kubeapi.names import CREDENTIALS_SECRET
from robovast.kubeapi.pod_contract.exit_codes import USELESS
from robovast.kubeapi.pod_contract.mounts import Mount
from robovast.kubeapi.pod_contract.pods import (
    OWN_USER,
    PROGRAM,
    TASK_RESOURCES,
    confined_pod,
    failure_policy,
    on_exit,
    own_container,
)
from robovast.kubeapi.resources import (
    API_VERSION,
    CAMPAIGN_LABEL,
    ROLE_LABEL,
    UID_LABEL,
    Scheduling,
)
from robovast.storage.bucket_names import bucket_name
from robovast.storage.shares.base import BaseShareProvider
from robovast.storage.shares.campaigns import SHARE_TYPE

Object = dict[str, Any]

ROLE = "share"
PROVIDER_FILE = "provider.py"
"""Name of the variable with a provider's file."""
RETRIES = 3
KEEP = 3600
"""How long the Job stays after its end, with its pods, their logs and the Secret [s]."""
GRACE_SECONDS = 5
"""No grace period: nothing of an interrupted upload is kept."""

_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Upload:
    """The results to upload, and the means."""

    campaign: str
    """Name of the results folder."""
    bucket: str
    endpoint: str
    """URL of the S3 server as pods reach it."""
    image: str
    """Our own image."""
    region: str | None = None
    secret: str = CREDENTIALS_SECRET
    """Secret with the keys of the S3 account."""
    owner: Mapping[str, Any] | None = None
    """The Campaign; None when it was removed."""
    scheduling: Scheduling = field(default_factory=Scheduling)

    @property
    def job(self) -> str:
        """Name of the Job: there is one at a time for each campaign."""
        return bucket_name(f"{self.bucket}-{ROLE}")


def share_variables(kind: str, provider: BaseShareProvider, folder: Path) -> dict[str, str]:
    """Variables of a provider in a pod, and its own file if it is one.

    Args:
        kind: value of `ROBOVAST_SHARE_TYPE`.
        provider: the provider of that kind.
        folder: what the path of a provider's file is relative to.

    Raises:
        InputError: a variable has no name that a variable can have.
    """
    given = {name: value for name, value in provider.build_pod_env().items() if value is not None}
    wrong = next((name for name in given if not _VARIABLE.fullmatch(name)), None)
    if wrong is not None:
        raise InputError(
            f"the share provider `{provider.SHARE_TYPE}` wants a variable `{wrong}` in its pod",
            hint="use a name of letters, digits and `_`",
        )
    variables = {name: str(value) for name, value in given.items()}
    parts = split_file_reference(kind)
    if parts is None:
        return {**variables, SHARE_TYPE: kind}
    path, name = parts
    text = read_text(folder / path)
    return {**variables, SHARE_TYPE: f"{PROVIDER_FILE}:{name}", PROVIDER_FILE: text}


def share_job(upload: Upload, secret: str) -> Object:
    """The Job of somebody who asks for an upload, suspended until the Secret is there.

    Args:
        upload: what it uploads.
        secret: name of the Secret that describes the share.
    """
    # Not the labels of the operator's own Jobs: it has nothing to do with this one.
    labels = {ROLE_LABEL: ROLE, **_campaign_labels(upload.owner)}
    metadata: Object = {"name": upload.job, "labels": labels}
    if upload.owner is not None:
        metadata["ownerReferences"] = [_reference(API_VERSION, "Campaign", upload.owner)]
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": metadata,
        "spec": {
            "suspend": True,
            **job_spec(),
            "template": {"metadata": {"labels": labels}, "spec": pod_spec(upload, secret)},
        },
    }


def job_spec() -> Object:
    """How an upload is tried again, and when its Job goes."""
    return {
        "backoffLimit": RETRIES,
        "ttlSecondsAfterFinished": KEEP,
        **failure_policy("FailJob", ROLE, on_exit("FailJob", ROLE, USELESS)),
    }


def pod_spec(upload: Upload, secret: str) -> Object:
    """The pod of an upload; it says itself what is missing in the Secret, or that there is none."""
    mounts, arguments = (Mount.CREDENTIALS, Mount.SHARE), [ROLE, *_arguments(upload)]
    container = own_container(upload.image, ROLE, arguments, mounts, TASK_RESOURCES)
    share = Mount.SHARE.secret(secret)
    share["secret"]["optional"] = True
    return confined_pod(OWN_USER, GRACE_SECONDS, upload.scheduling) | {
        "containers": [container],
        "volumes": [
            {"name": str(Mount.WORK), "emptyDir": {}},
            Mount.CREDENTIALS.secret(upload.secret),
            share,
        ],
    }


def share_secret(job: Mapping[str, Any], name: str, variables: Mapping[str, str]) -> Object:
    """The Secret that describes a share to a Job, and is deleted with the Job."""
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": name, "ownerReferences": [_reference("batch/v1", "Job", job)]},
        "immutable": True,
        "stringData": dict(variables),
    }


def agent_image(jobs: Iterable[Mapping[str, Any]]) -> str | None:
    """Our own image, as the operator's Deployment names it; None if none does."""
    pods = (job["spec"]["template"]["spec"] for job in jobs)
    for pod in pods:
        for container in [*pod["containers"], *(pod.get("initContainers") or ())]:
            if tuple(container.get("command") or ())[: len(PROGRAM)] == PROGRAM:
                return str(container["image"])
    return None


def _arguments(upload: Upload) -> list[str]:
    given = {
        "campaign": upload.campaign,
        "bucket": upload.bucket,
        "endpoint": upload.endpoint,
        "region": upload.region,
        "uid": upload.owner["metadata"]["uid"] if upload.owner is not None else None,
    }
    return [f"--{name}={value}" for name, value in given.items() if value]


def _campaign_labels(owner: Mapping[str, Any] | None) -> dict[str, str]:
    if owner is None:
        return {}
    metadata = owner["metadata"]
    return {CAMPAIGN_LABEL: metadata["name"], UID_LABEL: metadata["uid"]}


def _reference(version: str, kind: str, owner: Mapping[str, Any]) -> Object:
    metadata = owner["metadata"]
    return {
        "apiVersion": version,
        "kind": kind,
        "name": metadata["name"],
        "uid": metadata["uid"],
    }
