"""Reads untrusted YAML, and YAML files that contain a mapping."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import yaml

from robovast.base.errors import InputError
from robovast.base.file_errors import cause
from robovast.base.safe_paths import MOST, MOST_OF_ALL, read_file

YamlLoader: type[yaml.SafeLoader] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The pure Python loader if PyYAML was built without libyaml; it is slower but equivalent."""

_FAULTS = (yaml.YAMLError, RecursionError, ArithmeticError, AttributeError, LookupError, TypeError)
"""Exceptions of PyYAML about invalid text besides ValueError: `!!bool x` raises KeyError."""


MOST_LEVELS = 1000
"""Most levels of nesting; libyaml's parser of trees ends the process at some 20,000."""
MOST_VALUES = 50_000_000
"""Most values of a file with aliases, each counted as often as it is repeated."""
_MAY_BE_DEEP = re.compile(rf"(?<![ \-?:\0])[ \-?:\0]{{{MOST_LEVELS // 2}}}")
"""So many spaces and indicators as deep blocks need before a value, wherever YAML sees a new line:
also after a lone carriage return, U+0085, U+2028, U+2029 and a byte order mark."""


def check_depth(content: str | bytes) -> None:
    """Refuse YAML that is nested more than `MOST_LEVELS` deep, before it is made into a tree.

    The parser of events needs no stack. It is asked only where brackets or indentation allow such
    a depth, since it takes a fifth of the time of reading.

    Raises:
        yaml.YAMLError: it is nested too deeply, or is not valid.
    """
    text = content if isinstance(content, str) else content.decode("latin-1")
    if text.count("[") + text.count("{") <= MOST_LEVELS and not _MAY_BE_DEEP.search(text):
        return
    depth = 0
    for event in yaml.parse(content, Loader=YamlLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_LEVELS:
            raise yaml.MarkedYAMLError(
                problem=f"this is nested too deeply, more than {MOST_LEVELS:,} levels",
                problem_mark=event.start_mark,  # type: ignore[arg-type]  # or libyaml's, alike
            )


def parse_yaml(content: str | bytes) -> Any:
    """Parse the first document of YAML to plain data; others are ignored.

    Raises:
        ValueError: the YAML is invalid.
    """
    try:
        check_depth(content)
        data = next(yaml.load_all(content, Loader=YamlLoader), None)  # the safe one
        if (b"*" if isinstance(content, bytes) else "*") in content:  # type: ignore[operator]
            _refuse_repetition(data)
        return data
    except _FAULTS as error:
        raise ValueError(f"not valid YAML: {error}") from error


def _refuse_repetition(data: Any) -> None:
    """Refuse data that aliases repeat too often, or that contains itself: writing it has no end.

    Raises:
        ValueError: aliases do.
    """
    sizes: dict[int, float] = {}

    def size(value: Any) -> float:
        if not isinstance(value, dict | list | tuple):
            return 1
        if id(value) not in sizes:
            sizes[id(value)] = math.inf  # if it is part of itself
            inside = value.values() if isinstance(value, dict) else value
            sizes[id(value)] = 1 + sum(map(size, inside))
        return sizes[id(value)]

    if size(data) > MOST_VALUES:
        raise ValueError(
            f"not valid YAML: aliases (`*name`) repeat more than {MOST_VALUES:,} values, or a "
            "value is part of itself"
        )


def read_mapping(path: Path, most: int = MOST_OF_ALL) -> dict[str, Any]:
    """The mapping in a YAML file; empty if the file is missing or contains something else.

    Raises:
        InputError: the file cannot be read, or has more than `most` bytes.
    """
    try:
        data = parse_yaml(read_file(path, most=most))
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {cause(error)}") from error
    except ValueError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}


def read_mapping_leniently(path: Path) -> dict[str, Any]:
    """Like `read_mapping` for a file of one run or variant, but empty if it cannot be read."""
    try:
        return read_mapping(path, MOST)
    except InputError:
        return {}
