"""Reads fields that anybody may have written, whatever their shape, without exceptions.

What does not make sense is as good as missing. Behind this edge everything has its type.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robovast.base.ranges import Span, clip, merge, parse_ranges
from robovast.kubeapi.status import check_time

LARGEST = 2**31 - 1
"""Largest number in a Kubernetes object."""


def mapping(value: object) -> dict[str, Any]:
    """Return a mapping unchanged, anything else as an empty mapping."""
    return value if isinstance(value, dict) else {}


def listed(value: object) -> list[Any]:
    """Return a list unchanged, anything else as an empty list."""
    return value if isinstance(value, list) else []


def mappings(value: object) -> Iterator[dict[str, Any]]:
    """Return the mappings in a list; of anything else, none."""
    return (item for item in listed(value) if isinstance(item, dict))


def text(value: object, default: str = "") -> str:
    """Return a string unchanged, anything else as the default."""
    return value if isinstance(value, str) else default


def number(value: object, default: int = 0) -> int:
    """Return an integer that Kubernetes could hold, also from a string; else the default."""
    if isinstance(value, str) and value.isdecimal() and value.isascii() and len(value) < 20:
        value = int(value)
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return value if is_whole and 0 <= value <= LARGEST else default  # type: ignore[operator,return-value]


def ranges(value: object, size: int) -> list[Span]:
    """Return the ranges below a size in ascending order; none if the text is invalid."""
    try:
        return merge(clip(parse_ranges(text(value)), 0, size - 1))
    except ValueError:
        return []


def shaped(obj: object) -> dict[str, Any]:
    """Return an object whose metadata, labels, conditions and containers have the right types."""
    found = mapping(obj)
    return {
        **found,
        "metadata": _metadata(metadata(obj)),
        "spec": mapping(found.get("spec")),
        "status": _status(mapping(found.get("status"))),
    }


def metadata(obj: object) -> dict[str, Any]:
    """Return the metadata of an object, as they are."""
    return mapping(mapping(obj).get("metadata"))


def _metadata(given: dict[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = {
        **given,
        **{key: text(given.get(key)) for key in ("namespace", "name", "uid", "resourceVersion")},
        **{key: _texts(given[key]) for key in ("labels", "annotations") if key in given},
        "creationTimestamp": time(given.get("creationTimestamp")),
        "generation": number(given.get("generation")),
    }
    if "deletionTimestamp" in given:
        made["deletionTimestamp"] = time(given["deletionTimestamp"])
    if "ownerReferences" in given:
        owners = mappings(given["ownerReferences"])
        made["ownerReferences"] = [{**owner, **_named(owner, "uid", "name")} for owner in owners]
    if "finalizers" in given:
        made["finalizers"] = [name for name in listed(given["finalizers"]) if text(name)]
    return made


BEGINNING = "1970-01-01T00:00:00Z"


def time(value: object) -> str:
    """Return a time unchanged, anything else as the earliest time."""
    try:
        return check_time(text(value))
    except ValueError:
        return BEGINNING


def _status(given: dict[str, Any]) -> dict[str, Any]:
    made = dict(given)
    if "conditions" in given:
        made["conditions"] = [
            {**item, **_named(item, "type", "status", "reason", "message")}
            for item in mappings(given["conditions"])
        ]
    for key in ("initContainerStatuses", "containerStatuses"):
        if key in given:
            made[key] = [_container(item) for item in mappings(given[key])]
    return made


def _container(given: dict[str, Any]) -> dict[str, Any]:
    states: dict[str, Any] = {
        key: {
            name: {
                **mapping(state),
                **_named(mapping(state), "reason", "message"),
                "exitCode": number(mapping(state).get("exitCode"), -1),
            }
            for name, state in mapping(given[key]).items()
        }
        for key in ("state", "lastState")
        if key in given
    }
    return given | _named(given, "name", "image") | states


def _named(given: dict[str, Any], *names: str) -> dict[str, str]:
    return {name: text(given.get(name)) for name in names}


def _texts(value: object) -> dict[str, str]:
    return {name: item for name, item in mapping(value).items() if isinstance(item, str)}
