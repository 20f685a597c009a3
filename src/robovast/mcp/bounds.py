"""Limits the size of answers and marks what was cut."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic_core import to_jsonable_python

MOST_BYTES = 30_000
"""Largest size of an answer as JSON [bytes]."""
_ITEM_BYTES = 6_000
"""Largest size of a list item as JSON [bytes]."""


@dataclass(frozen=True)
class _Limits:
    text: int
    """Characters per text."""
    many: int
    """Items per list or mapping."""


_STEPS = tuple(_Limits(*pair) for pair in ((8000, 400), (2000, 100), (500, 40), (150, 12), (60, 4)))
_DEEPEST = 12
_TOO_DEEP = "… (nested too deeply to be shown)"


def fitted(value: Any, most: int = MOST_BYTES) -> Any:
    """A value as JSON data, truncated only as far as necessary.

    Args:
        value: dataclasses, mappings, sequences, scalars.
        most: largest size of the result as JSON [bytes].
    """
    data = to_jsonable_python(_shallow(value, _DEEPEST), fallback=str, bytes_mode="base64")
    for limits in _STEPS:
        result = _cut(data, limits, _DEEPEST)
        if size(result) <= most:
            return result
    return _shortened(json.dumps(result, ensure_ascii=False), most // 8)


def page(items: Sequence[Any], offset: int = 0, *, name: str = "items") -> dict[str, Any]:
    """Return as many items from an offset on as fit into an answer.

    Returns:
        The items under `name`; `total`; if some are missing, `cut` with the way to continue.
    """
    begin = max(0, offset)
    chosen: list[Any] = []
    left = MOST_BYTES
    for item in items[begin:]:
        data = fitted(item, _ITEM_BYTES)
        left -= size(data) + 1
        if left < 0:
            break
        chosen.append(data)
    answer: dict[str, Any] = {name: chosen, "total": len(items)}
    end = begin + len(chosen)
    if end < len(items):
        answer["cut"] = f"{name} {begin} to {end - 1} of {len(items)}; continue with offset={end}"
    return answer


def size(data: Any) -> int:
    """Size of plain data as JSON [bytes]."""
    return len(json.dumps(data, ensure_ascii=False).encode())


def _shallow(value: Any, depth: int) -> Any:
    """A value without what is nested too deeply to be made JSON, nor keys that cannot be."""
    if not isinstance(value, list | tuple | dict):
        return value
    if depth == 0:
        return _TOO_DEEP
    if not isinstance(value, dict):
        return [_shallow(item, depth - 1) for item in value]
    return {_encodable(key): _shallow(item, depth - 1) for key, item in value.items()}


def _encodable(key: Any) -> Any:
    return key.encode("utf-8", "replace").decode() if isinstance(key, str) else key


def _cut(data: Any, limits: _Limits, depth: int) -> Any:
    if isinstance(data, str):
        return _shortened(data, limits.text)
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if not isinstance(data, list | dict):
        return data
    if depth == 0:
        return _TOO_DEEP
    if isinstance(data, dict):
        return _cut_mapping(data, limits, depth)
    kept = [_cut(item, limits, depth - 1) for item in data[: limits.many]]
    return kept if len(kept) == len(data) else [*kept, f"… ({len(data) - len(kept)} more cut)"]


def _cut_mapping(data: Mapping[str, Any], limits: _Limits, depth: int) -> dict[str, Any]:
    kept = {
        _shortened(str(key), 200): _cut(item, limits, depth - 1)
        for key, item in list(data.items())[: limits.many]
    }
    if len(data) > limits.many:
        kept["…"] = f"({len(data) - limits.many} more cut)"
    return kept


def _shortened(text: str, most: int) -> str:
    whole: str = _encodable(text)  # lone surrogates cannot be
    if len(whole) <= most:
        return whole
    return f"{whole[:most]}… ({len(whole) - most} characters cut)"
