"""Serialization of plain data, equal for JSON and YAML everywhere."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from datetime import date, datetime
from pathlib import PurePath
from typing import Any

import yaml

try:
    from yaml import CSafeDumper as _SafeDumper
except ImportError:  # PyYAML built without libyaml: slower, same result
    from yaml import SafeDumper as _SafeDumper  # type: ignore[assignment]


_OTHER_VALUE = re.compile(
    r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|0o[0-7]+|[yYnN]"
)
"""Text that PyYAML writes without quotes, and that readers of YAML 1.2 or of 1.1 take for a number
or a truth value."""


class _Dumper(_SafeDumper):
    """Writes repeated values in full, without anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        del data
        return True


def _text(dumper: Any, text: str) -> yaml.ScalarNode:
    """Lines as a block, which people can compare; quotes if readers could see another value."""
    style = "|" if "\n" in text else "'" if _OTHER_VALUE.fullmatch(text) else None
    node: yaml.ScalarNode = dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)
    return node


_Dumper.add_representer(str, _text)


def to_plain(value: Any) -> Any:
    """Convert a value to dicts, lists, text, numbers, booleans, dates and None.

    Plugins return tuples, paths, enumerations and numpy values as well.
    """
    if value is None or isinstance(value, bool | int | float | str | date):
        return value if type(value) in _EXACT else _base_value(value)
    if isinstance(value, Mapping):
        return {_key(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, PurePath):
        return str(value)
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return to_plain(value.tolist())
    if hasattr(value, "model_dump"):
        return to_plain(value.model_dump())
    if isinstance(value, Iterable):
        return [to_plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} cannot be written as YAML or JSON: {value!r}")


_EXACT = {type(None), bool, int, float, str, date, datetime}


def _base_value(value: Any) -> Any:
    """Convert a value of a subclass (an enumeration, numpy.float64) to its base type."""
    if isinstance(value, bool | date):
        return value
    if isinstance(value, int):
        return int(value)
    return float(value) if isinstance(value, float) else str(value)


def _key(key: Any) -> Any:
    return key if type(key) in (str, int, bool) else str(key)


def dump_yaml(data: Any) -> str:
    """YAML in the order of the data, block style, without line folding."""
    text: str = yaml.dump(
        data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=2**31 - 1
    )
    return text


def dump_yaml_documents(documents: Iterable[Any]) -> str:
    """Several YAML documents, separated by `---`."""
    return "---\n".join(dump_yaml(document) for document in documents)


def spelled(value: Any) -> str:
    """A value in one line, different for different values.

    Text is in quotes if it could be another value, or if its beginning or end cannot be seen.
    """
    if not isinstance(value, str):
        return _TO_LINE.encode(value)
    return _TO_LINE.encode(value) if value.strip() != value or _is_json(value) else value


def _is_json(text: str) -> bool:
    try:
        json.loads(text or "null")
    except (ValueError, RecursionError):
        return False
    return True


def fingerprint(data: Any) -> str:
    """SHA-256 of plain data, equal for equal data on all machines."""
    return hashlib.sha256(_ENCODER.encode(data).encode()).hexdigest()


_TO_LINE = json.JSONEncoder(ensure_ascii=False, default=str)
_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), default=str)
