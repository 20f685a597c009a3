"""YAML as anyone may have written it, and files that hold a mapping."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from robovast.base.errors import InputError
from robovast.base.safe_paths import MOST, MOST_OF_ALL, read_file

YamlLoader: type[yaml.SafeLoader] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Where PyYAML was built without libyaml, the slower one, with the same result."""

_FAULTS = (yaml.YAMLError, RecursionError, ArithmeticError, AttributeError, LookupError, TypeError)
"""What PyYAML raises of text that is not valid, beside ValueError: `!!bool x` is a KeyError."""


def parse_yaml(content: str | bytes) -> Any:
    """The first document in YAML as plain data; others have no effect.

    Raises:
        ValueError: it is not valid.
    """
    try:
        return next(yaml.load_all(content, Loader=YamlLoader), None)  # the safe one
    except _FAULTS as error:
        raise ValueError(f"not valid YAML: {error}") from error


def read_mapping(path: Path, most: int = MOST_OF_ALL) -> dict[str, Any]:
    """Content of a YAML file; empty when there is no such file, or it holds no mapping.

    Raises:
        InputError: it cannot be read, or has more than `most` bytes.
    """
    try:
        data = parse_yaml(read_file(path, most=most))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}


def read_mapping_leniently(path: Path) -> dict[str, Any]:
    """As `read_mapping`, of a file of one run or variant; empty when it cannot be read, too."""
    try:
        return read_mapping(path, MOST)
    except InputError:
        return {}
