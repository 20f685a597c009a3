"""Amounts of CPU and memory, resolved for one cluster context or for this machine."""

from __future__ import annotations

import os
import re
from typing import Any

from robovast.base.errors import InputError

LOCAL_CONTEXT = "local"
"""Key for local runs in per-cluster lists."""

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
            f"{key} has no value for `{context}`; it has values for {', '.join(values)}. Add "
            f"`- {context}: …`, or give one value for all."
        )
    return values[context]


def cpus(value: Any, key: str, context: str = LOCAL_CONTEXT) -> float | None:
    """CPU cores from `2`, `0.5` or `500m`; None without a value."""
    resolved = resolve_per_context(value, context, key)
    if resolved is None:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(m?)", str(resolved).strip())
    if not match or float(match[1]) <= 0:
        raise InputError(
            f"{key}: `{resolved}` is not a number of CPUs; write `2`, `0.5` or `500m`."
        )
    return float(match[1]) / (1000 if match[2] else 1)


def memory(value: Any, key: str, context: str = LOCAL_CONTEXT) -> int | None:
    """Memory [byte] from `8Gi`, `4096Mi` or a number of bytes; None without a value."""
    resolved = resolve_per_context(value, context, key)
    if resolved is None:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([A-Za-z]*)", str(resolved).strip())
    if not match or match[2] not in _UNITS:
        raise InputError(
            f"{key}: `{resolved}` is not an amount of memory; write `8Gi` or `4096Mi`."
        )
    return int(float(match[1]) * _UNITS[match[2]])


def machine_cpus() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0))


def machine_memory() -> int:
    """Physical memory of this machine [byte]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
