"""What an installation decides: read from the environment, which the chart writes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from robovast.base.errors import InputError
from robovast.kubeapi.pod_contract.pods import AGENT_RESOURCES, TASK_RESOURCES
from robovast.model.expansion.limit import DEFAULT, variant_limit


@dataclass(frozen=True)
class OperatorSettings:
    """Settings of the operator."""

    agent_image: str
    """Image of the agent, compose, finish and purge containers."""
    endpoint: str
    """URL of the S3 server as pods reach it, for Campaigns that name none."""
    region: str | None = None
    """Its region."""
    namespaces: tuple[str, ...] = ()
    """Namespaces to work in; none means all."""
    secret_names: tuple[str, ...] = ()
    """Secrets that Campaigns may use in addition to Secrets with the prefix."""
    pod_annotations: tuple[str, ...] = ()
    """Annotations that a Campaign may set on its pods."""
    pod_labels: tuple[str, ...] = ()
    """Labels that a Campaign may set on its pods."""
    reuse_namespaces: tuple[str, ...] = ()
    """Namespaces whose Campaigns may reuse runs; `*` means all."""
    restricted_runs: bool = True
    """Whether run containers may not gain privileges."""
    work_request: str = ""
    """Room on its node's disk that a run's pod asks for; none when empty."""
    work_limit: str = ""
    """Most that a pod may hold on its disk, as Kubernetes writes amounts; unlimited when empty."""
    agent_resources: dict[str, Any] = field(default_factory=lambda: AGENT_RESOURCES)
    """Resources of our containers in the pods of runs, as in a pod."""
    task_resources: dict[str, Any] = field(default_factory=lambda: TASK_RESOURCES)
    """Resources of our containers in Jobs for a whole campaign."""
    architectures: tuple[str, ...] = ()
    """Processor architectures of the agent's image, for example `amd64` (default: any)."""
    lease_namespace: str = "default"
    """Where the Lease is that makes one of several replicas the leader."""
    identity: str = "operator"
    """Name of this replica."""
    variant_limit: int = DEFAULT
    """Most variants of a document."""
    port: int = 8080
    """Port of /healthz, /readyz and /metrics."""
    stall_seconds: float = 15.0
    """How long nothing moves before the operator looks for the cause."""
    silence_minutes: float = 30.0
    """Time without log output after which a run is reported [min]."""
    notify_seconds: float = 300.0
    """Delay before a stalled campaign triggers a notification [s]."""
    status_seconds: float = 5.0
    """Least time between two writes of one status, unless a condition changes."""
    resync_seconds: float = 600.0
    """Interval between two comparisons of the store with the cluster [s]."""
    silence_seconds: float = 70.0
    """Time without an event after which a watch is restarted; servers send one per minute [s]."""
    lease_seconds: float = 15.0
    """How long a leader that has gone is waited for."""


def read_settings(environment: Mapping[str, str] = os.environ) -> OperatorSettings:
    """Return settings from ROBOVAST_* variables.

    Raises:
        InputError: one that must be there is missing, or a number or limit is none.
    """

    def needed(name: str) -> str:
        value = environment.get(name, "")
        if not value:
            raise InputError(
                f"The environment variable {name} is not set",
                hint=f"install the operator with the chart, which sets {name}",
            )
        return value

    def number(setting: str) -> float:
        name = f"ROBOVAST_{setting.upper()}"
        value = environment.get(name, "")
        try:
            return float(value) if value else float(getattr(OperatorSettings, setting))
        except ValueError as error:
            raise InputError(
                f"The environment variable {name} is not a number: {value}.",
                hint="correct the values of the chart",
            ) from error

    def names(variable: str) -> tuple[str, ...]:
        given = environment.get(variable, "").split(",")
        return tuple(name.strip() for name in given if name.strip())

    numbers = {
        f.name: number(f.name) for f in fields(OperatorSettings) if isinstance(f.default, float)
    }
    return OperatorSettings(
        agent_image=needed("ROBOVAST_AGENT_IMAGE"),
        endpoint=needed("ROBOVAST_S3_ENDPOINT"),
        region=environment.get("ROBOVAST_S3_REGION") or None,
        namespaces=names("ROBOVAST_NAMESPACES"),
        secret_names=names("ROBOVAST_SECRET_NAMES"),
        pod_annotations=names("ROBOVAST_POD_ANNOTATIONS"),
        pod_labels=names("ROBOVAST_POD_LABELS"),
        reuse_namespaces=names("ROBOVAST_REUSE_NAMESPACES"),
        restricted_runs=environment.get("ROBOVAST_RESTRICTED_RUNS", "true") != "false",
        work_request=environment.get("ROBOVAST_WORK_REQUEST", ""),
        work_limit=environment.get("ROBOVAST_WORK_LIMIT", ""),
        agent_resources=_resources(environment, "ROBOVAST_AGENT_RESOURCES", AGENT_RESOURCES),
        task_resources=_resources(environment, "ROBOVAST_TASK_RESOURCES", TASK_RESOURCES),
        architectures=names("ROBOVAST_ARCHITECTURES"),
        lease_namespace=environment.get("POD_NAMESPACE", "default"),
        identity=environment.get("POD_NAME", f"operator-{os.getpid()}"),
        variant_limit=variant_limit(environment),
        port=int(number("port")),
        **numbers,
    )


def _resources(
    environment: Mapping[str, str], variable: str, default: dict[str, Any]
) -> dict[str, Any]:
    try:
        return dict(json.loads(environment.get(variable) or json.dumps(default)))
    except (ValueError, TypeError) as error:
        raise InputError(
            f"The environment variable {variable} is not a JSON object with `requests` and "
            "`limits`",
            hint="correct the resources in the values of the chart",
        ) from error
