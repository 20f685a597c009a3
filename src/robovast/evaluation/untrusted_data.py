"""Parses JSON and YAML from untrusted files to safe data."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

from robovast.base import yaml_files
from robovast.base.errors import InputError
from robovast.evaluation.confined_files import read_small

MOST_VALUES = 20_000
"""Most values of a document; a small one with anchors can expand to billions."""
DEEPEST = 30
LONGEST = 20_000
"""Longest text [characters]."""


def parse_json(content: bytes) -> Any:
    """Parse JSON; None if it is invalid."""
    try:
        return plain(json.loads(content))
    except (ValueError, RecursionError):
        return None


def parse_yaml(content: bytes) -> Any:
    """Parse the first document of YAML; None if it is invalid."""
    try:
        return plain(yaml_files.parse_yaml(content))
    except ValueError:
        return None


def read_yaml(root: Path, relative: str) -> Mapping[str, Any]:
    """The mapping in a small YAML file below a folder; empty if there is none."""
    try:
        return mapping(parse_yaml(read_small(root, relative)))
    except InputError:
        return {}


def mapping(value: Any) -> Mapping[str, Any]:
    """The value if it is a mapping, otherwise an empty one."""
    return value if isinstance(value, dict) else {}


def plain(value: Any) -> Any:
    """A copy as JSON data, limited in size and depth.

    Raises:
        ValueError: it has more than `MOST_VALUES` values, or is nested too deeply.
    """
    return _plain(value, [MOST_VALUES], DEEPEST)


def _plain(value: Any, left: list[int], depth: int) -> Any:
    left[0] -= 1
    if left[0] < 0 or depth < 0:
        raise ValueError("the document is too large")
    if isinstance(value, dict):
        return {str(key)[:LONGEST]: _plain(v, left, depth - 1) for key, v in value.items()}
    if isinstance(value, list | tuple | set):
        return [_plain(item, left, depth - 1) for item in value]
    return _scalar(value)


def _scalar(value: Any) -> Any:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int) and abs(value) < 2**53:
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value.isoformat() if isinstance(value, date) else str(value)[:LONGEST]
