"""Explain which ResourceQuota or LimitRange of a namespace refuses a pod or Job. Pure functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

from kubernetes.utils.quantity import parse_quantity

from robovast_operator.kube.objects import Object
from robovast_operator.kube.untrusted_fields import mapping, mappings, metadata, text

OWN_CPU_LIMIT = "500m"
"""CPU limit of our containers where a ResourceQuota requires one."""

JOBS = "count/jobs.batch"
"""Resource of a ResourceQuota that counts Jobs."""

_OF_CAMPAIGNS = ("configmaps", ".robovast.io")
"""Ends of resources whose objects stay until their Campaign is deleted."""

_KEPT = (
    "Each Campaign keeps such objects until it is deleted. Remove finished Campaigns "
    "(`vast exec cluster run-cleanup`)"
)

_MISSING = re.compile(r"failed quota: ([^:\s]+): must specify (.+?)\.?$")
_EXCEEDED = re.compile(r"exceeded quota: ([^,\s]+), requested: (.+), used: (.+), limited: (\S+)")


@dataclass(frozen=True)
class NamespaceLimits:
    """The ResourceQuotas and LimitRanges of a namespace, as far as the operator may read them."""

    quotas: Sequence[Object] = ()
    ranges: Sequence[Object] = ()


def with_required_limits(job: Object, limits: NamespaceLimits, own: Iterable[str]) -> Object:
    """Add a CPU limit to our containers of a Job if a ResourceQuota requires one.

    Args:
        job: the Job; it is not modified.
        limits: of its namespace.
        own: names of our containers.
    """
    hard = {
        key for quota in limits.quotas for key in mapping(mapping(quota.get("spec")).get("hard"))
    }
    if "limits.cpu" not in hard:
        return job
    template = job["spec"]["template"]
    names = set(own)
    pod = {
        kind: [_limited(one) if one["name"] in names else one for one in template["spec"][kind]]
        for kind in ("initContainers", "containers")
        if kind in template["spec"]
    }
    return job | {"spec": job["spec"] | {"template": template | {"spec": template["spec"] | pod}}}


def _limited(container: Object) -> Object:
    resources = mapping(container.get("resources"))
    limits = {"cpu": OWN_CPU_LIMIT} | mapping(resources.get("limits"))
    return container | {"resources": {**resources, "limits": limits}}


def counts_jobs(message: str) -> bool:
    """Return whether a ResourceQuota on the number of Jobs is why a Job is rejected."""
    found = _EXCEEDED.search(message)
    return found is not None and JOBS in _amounts(found[2])


def explain(message: str, pod: Object, limits: NamespaceLimits, own: Iterable[str] = ()) -> str:
    """Explain why an API server refuses a pod: the object, the field, and what to change.

    Args:
        message: of the API server.
        pod: spec of the pod.
        limits: of its namespace.
        own: names of our containers; all others are those of the run.

    Returns:
        Sentences, or an empty string if neither a ResourceQuota nor a LimitRange explains it.
    """
    found = _MISSING.search(message)
    if found is not None:
        return " ".join(_missing(found[1], found[2], frozenset(own)))
    found = _EXCEEDED.search(message)
    if found is not None:
        return " ".join(_exceeded(found[1], found[2], found[3], found[4]))
    return " ".join(_out_of_range(pod, limits.ranges, frozenset(own)))


def _missing(quota: str, demanded: str, own: frozenset[str]) -> Iterator[str]:
    for demand in demanded.split(";"):
        field, _, names = demand.strip().partition(" for: ")
        for name in names.split(","):
            yield (
                f"ResourceQuota `{quota}` requires {field} for every container, and the container "
                f"`{name}` does not set it. {_remedy(name, field, own)}"
            )


def _exceeded(quota: str, requested: str, used: str, limited: str) -> Iterator[str]:
    wanted, taken, allowed = _amounts(requested), _amounts(used), _amounts(limited)
    for resource, amount in wanted.items():
        yield (
            f"ResourceQuota `{quota}` allows {allowed.get(resource, '?')} of {resource}: "
            f"{taken.get(resource, '?')} are used, and {amount} more are needed. "
            f"{_KEPT if resource.endswith(_OF_CAMPAIGNS) else 'Wait until other work finishes'}, "
            f"or ask your cluster administrator to raise spec.hard.{resource}."
        )


def _amounts(listed: str) -> dict[str, str]:
    return dict(part.strip().split("=", 1) for part in listed.split(",") if "=" in part)


def _out_of_range(pod: Object, ranges: Iterable[Object], own: frozenset[str]) -> Iterator[str]:
    items = [
        (text(metadata(found).get("name")), item)
        for found in ranges
        for item in mappings(mapping(found.get("spec")).get("limits"))
    ]
    defaults = [item for _, item in items if item.get("type") == "Container"]
    together = list(mappings(pod.get("containers")))
    containers = [*mappings(pod.get("initContainers")), *together]
    for name, item in items:
        if item.get("type") == "Container":
            for container in containers:
                who = text(container.get("name"))
                for problem, field in _violations(_amounts_of(container, defaults), item):
                    yield f"LimitRange `{name}` {problem} (container `{who}`). " + _remedy(
                        who, field, own
                    )
        elif item.get("type") == "Pod":
            used = [_amounts_of(container, defaults) for container in together]
            sums = _sums(limits for limits, _ in used), _sums(requests for _, requests in used)
            for problem, field in _violations(sums, item):
                yield (
                    f"LimitRange `{name}` {problem} (all containers of the pod together). Change "
                    f"`{field.rpartition('.')[2]}` in `resources` of the .vast file, or ask for "
                    "another limit. Your cluster administrator can also change `agent.resources` "
                    "of the Helm chart (Jobs for a whole campaign: `agent.taskResources`)."
                )


Amounts = Mapping[str, object]
"""Amount by resource."""


def _amounts_of(container: Object, defaults: Iterable[Object]) -> tuple[Amounts, Amounts]:
    """Return the limits and requests of a container, with the defaults of LimitRanges."""
    given = mapping(container.get("resources"))
    limits, requests = dict(mapping(given.get("limits"))), dict(mapping(given.get("requests")))
    requests = limits | requests
    for item in defaults:
        limits = dict(mapping(item.get("default"))) | limits
        requests = {
            **mapping(item.get("default")),
            **mapping(item.get("defaultRequest")),
            **requests,
        }
    return limits, requests


def _sums(amounts: Iterable[Amounts]) -> Amounts:
    total: dict[str, Decimal] = {}
    for one in amounts:
        for resource, amount in one.items():
            total[resource] = total.get(resource, Decimal(0)) + _value(amount)
    return {resource: _shown(amount) for resource, amount in total.items()}


def _shown(amount: Decimal) -> str:
    mebibytes, rest = divmod(amount, 2**20)
    return f"{mebibytes}Mi" if mebibytes and not rest else f"{amount.normalize():f}"


def _violations(used: tuple[Amounts, Amounts], item: Object) -> Iterator[tuple[str, str]]:
    """Compare limits and requests with one item of a LimitRange."""
    limit, request = used
    for resource, least in mapping(item.get("min")).items():
        if (asked := request.get(resource)) is None or _value(asked) < _value(least):
            field = f"requests.{resource}"
            yield f"requires at least {least} for {field}, not {asked or 'none'}", field
    for resource, most in mapping(item.get("max")).items():
        if (bound := limit.get(resource)) is None or _value(bound) > _value(most):
            field = f"limits.{resource}"
            yield f"allows at most {most} for {field}, not {bound or 'no limit'}", field
    for resource, ratio in mapping(item.get("maxLimitRequestRatio")).items():
        bound, asked = limit.get(resource), request.get(resource)
        if bound is None or asked is None or _value(bound) > _value(ratio) * _value(asked):
            field = f"limits.{resource}"
            yield f"allows at most {ratio} for the ratio of {field} to its request", field


def _value(amount: object) -> Decimal:
    try:
        return Decimal(parse_quantity(str(amount)))
    except ValueError:
        return Decimal(0)


def _remedy(container: str, field: str, own: frozenset[str]) -> str:
    if container in own:
        return (
            f"Ask your cluster administrator to set `agent.resources.{field}` of the Helm chart "
            "(Jobs for a whole campaign: `agent.taskResources`)."
        )
    resource = field.rpartition(".")[2]
    if resource not in {"cpu", "memory"}:
        return "Ask your cluster administrator for a LimitRange with a default."
    key = "execution.resources" if container == "robovast" else "its `resources`"
    return f"Set `{resource}` in {key} of the .vast file, or ask for another limit."
