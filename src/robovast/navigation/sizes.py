"""Determines sizes of obstacles from the arguments of their models."""

from __future__ import annotations

import math
import re

DEFAULT_RADIUS = 0.25
"""Default radius of an obstacle without size arguments [m]."""

_SIZE = re.compile(r"\b(width|length|radius)\s*:=\s*([-+]?[0-9][0-9.eE+-]*|[-+]?\.[0-9]+)")


def radius_of(xacro_arguments: str) -> float:
    """Radius of a disc around an obstacle, from its `width`, `length` and `radius` [m].

    Raises:
        ValueError: a size is not above 0.
    """
    found = sizes_of(xacro_arguments)
    if "radius" in found:
        return found["radius"]
    width, length = found.get("width"), found.get("length")
    if width is None and length is None:
        return DEFAULT_RADIUS
    return math.hypot(width or length or 0.0, length or width or 0.0) / 2


def sizes_of(xacro_arguments: str) -> dict[str, float]:
    """The given ones of an obstacle's `width`, `length` and `radius` [m].

    Raises:
        ValueError: a size is not above 0.
    """
    return {key: _positive(key, value) for key, value in _SIZE.findall(xacro_arguments)}


def _positive(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if value > 0:
        return value
    raise ValueError(f"`{key}` of an obstacle must be a number above 0, not {text}")
