"""Amounts of CPU and memory, resolved for one cluster context or for this machine."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from typing import Any, TypeVar

from robovast.base.errors import InputError

Number = TypeVar("Number", int, float)

LOCAL_CONTEXT = "local"
"""Key for local runs in per-cluster lists."""

EXTENDED_RESOURCE = r"^[a-z0-9]([-a-z0-9.]*[a-z0-9])?/[A-Za-z0-9]([-A-Za-z0-9_.]*[A-Za-z0-9])?$"
"""Name of what nodes have beside CPU and memory, such as `amd.com/gpu`."""

LEAST = 2**20
"""Least memory or disk that a run can do with [byte]."""

_MOST_BYTES, _MOST = 2**63 - 1, 2**31 - 1
"""More than any machine has, and the most that Kubernetes and Docker can count."""

_UNITS = {
    "": 1,
    "k": 10**3,
    "K": 10**3,
    "M": 10**6,
    "G": 10**9,
    "T": 10**12,
    "Ki": 2**10,
    "Mi": 2**20,
    "Gi": 2**30,
    "Ti": 2**40,
}


def resolve_per_context(value: Any, context: str, key: str) -> Any:
    """The value for a context: a scalar as it is, or a list's item for the context.

    Raises:
        InputError: the list has no entry for the context.
    """
    if not isinstance(value, list):
        return value
    values = {name: item for pair in value for name, item in pair.items()}
    if context not in values:
        raise InputError(
            f"{key} has no value for `{context}`; it has values for {', '.join(values)}",
            hint=f"add `- {context}: …`, or give one value for all",
        )
    return values[context]


def cpus(value: Any, key: str, context: str = LOCAL_CONTEXT) -> float | None:
    """CPU cores from `2`, `0.5` or `500m`; None without a value."""
    return _read(parse_cpus, value, key, context)


def memory(value: Any, key: str, context: str = LOCAL_CONTEXT) -> int | None:
    """Memory [byte] from `8Gi`, `4096Mi` or a number of bytes; None without a value."""
    return _read(parse_memory, value, key, context)


def memory_limit(value: Any, key: str, context: str = LOCAL_CONTEXT) -> int | None:
    """Memory of a container [byte]; None without a value."""
    return _read(parse_memory_limit, value, key, context)


def gpus(value: Any, key: str, context: str = LOCAL_CONTEXT) -> int | None:
    """Number of GPUs of a container; None without a value."""
    return _read(parse_gpus, value, key, context)


def _read(parse: Callable[[Any], Number], value: Any, key: str, context: str) -> Number | None:
    resolved = resolve_per_context(value, context, key)
    if resolved is None:
        return None
    try:
        return parse(resolved)
    except InputError as error:
        raise InputError(f"{key}: {error.message}", hint=error.hint) from None


def parse_cpus(value: Any) -> float:
    """CPU cores from `2`, `0.5` or `500m`.

    Raises:
        InputError: it is none of these.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(m?)", str(value).strip())
    if not match or not 0 < float(match[1]) <= _MOST:
        raise InputError(f"`{value}` is not a number of CPUs", hint="write `2`, `0.5` or `500m`")
    return float(match[1]) / (1000 if match[2] else 1)


def parse_gpus(value: Any) -> int:
    """Number of GPUs.

    Raises:
        InputError: it is none.
    """
    match = re.fullmatch(r"\d{1,10}", str(value).strip())
    if not match or int(match[0]) > _MOST:
        raise InputError(f"`{value}` is not a number of GPUs", hint="write `0`, `1` or `2`")
    return int(match[0])


def parse_memory(value: Any) -> int:
    """Memory [byte] from `8Gi`, `4096Mi` or a number of bytes.

    Raises:
        InputError: it is none of these.
    """
    return int(_parse_bytes(value, "memory"))


def parse_memory_limit(value: Any) -> int:
    """Memory of a container [byte].

    Raises:
        InputError: it is no amount, or so small that its unit must have been forgotten.
    """
    return _not_tiny(value, _parse_bytes(value, "memory"))


def parse_disk(value: Any) -> int:
    """Disk of a pod [byte].

    Raises:
        InputError: it is no amount, or so small that its unit must have been forgotten.
    """
    return _not_tiny(value, _parse_bytes(value, "disk"))


def _parse_bytes(value: Any, what: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([A-Za-z]*)", str(value).strip())
    if not match or match[2] not in _UNITS:
        raise InputError(
            f"`{value}` is not a valid quantity of {what}", hint="write `8Gi` or `4096Mi`"
        )
    found = float(match[1]) * _UNITS[match[2]]
    if found > _MOST_BYTES:
        raise InputError(
            f"`{value}` is more {what} than any machine has", hint="write `8Gi` or `4096Mi`"
        )
    return found


def _not_tiny(value: Any, found: float) -> int:
    """Refuse an amount in which nothing can run; 0, where it is allowed, is no limit."""
    if not 0 < found < LEAST:
        return int(found)
    given = str(value).strip()
    meant = f"write for example `{given}{'Gi' if found < 2**10 else 'Mi'}`"
    hint = meant if given[-1].isdigit() else "write `8Gi` or `4096Mi`"
    size = f"{found:,.16g} bytes"
    raise InputError(f"`{value}` is {size}; no run can do with less than 1Mi", hint=hint)


def shared_memory(size: Any, memory_limit: Any, context: str = LOCAL_CONTEXT) -> int | None:
    """Size of `/dev/shm` [byte]; None without a value.

    Args:
        size: `execution.resources.shm_size`.
        memory_limit: `execution.resources.memory`, which what is in `/dev/shm` counts to.
        context: of the cluster.

    Raises:
        InputError: it is no amount, or more than the memory.
    """
    key = "execution.resources.shm_size"
    found = memory(size, key, context)
    most = memory(memory_limit, "execution.resources.memory", context)
    if found is not None and (found <= 0 or found > (most or found)):
        raise InputError(
            f"{key}: `/dev/shm` is memory of the container: its size must be more than nothing, "
            "and no more than `memory`",
            hint="increase `memory`, or choose a smaller `shm_size`",
        )
    return found


def gpu_resource(value: Any, context: str) -> str:
    """Name of the resource that the number of GPUs counts.

    Args:
        value: `execution.kubernetes.gpu_resource`.
        context: of the cluster.

    Raises:
        InputError: it is no such name.
    """
    key = "execution.kubernetes.gpu_resource"
    found = str(resolve_per_context(value, context, key))
    if not re.fullmatch(EXTENDED_RESOURCE, found):
        raise InputError(
            f"{key}: `{found}` is not a valid name of a resource",
            hint="use for example `nvidia.com/gpu`",
        )
    return found


def disk(value: Any, context: str, most: str) -> int | None:
    """Disk of a pod [byte]; None without a value.

    Args:
        value: `execution.kubernetes.ephemeral_storage`.
        context: of the cluster.
        most: what the installation allows; anything when empty.

    Raises:
        InputError: it is no amount, or more than that.
    """
    key = "execution.kubernetes.ephemeral_storage"
    found = _read(parse_disk, value, key, context)
    limit = memory(most, "agent.diskLimit") if most else None
    if found is not None and (found <= 0 or found > (limit or found)):
        allowed = f" and no more than {most}, the limit of this installation" if most else ""
        hint = "ask your administrator to raise `agent.diskLimit` of the chart" if most else ""
        raise InputError(f"{key}: a pod's disk must be more than nothing{allowed}", hint=hint)
    return found


def machine_cpus() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0))


def machine_memory() -> int:
    """Physical memory of this machine [byte]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
