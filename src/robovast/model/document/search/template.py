"""Parameter sets become configuration entries: markers in the template are replaced by values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

from robovast.model.document.model import ConfigurationEntry
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import set_id
from robovast.model.document.section import PluginCall, merge_pairs

_MARKER = re.compile(r"\$(?:(?P<plain>[A-Za-z_]\w*)|\{(?P<braced>[A-Za-z_]\w*)\})")

_UNCLOSED = re.compile(r"\$\{[A-Za-z_]\w*")

Path = tuple[str | int, ...]


def markers(value: Any, path: Path = ()) -> Iterator[tuple[Path, str]]:
    """Path and name of every marker in a template, or in a part of it."""
    if isinstance(value, str) and (name := _marker(value)):
        yield path, name
    for key, inner in _items(value):
        yield from markers(inner, (*path, key))


def doubtful(value: Any, path: Path = ()) -> Iterator[tuple[Path, str]]:
    """Path and text of strings with a marker in the middle, which is not replaced."""
    is_text = isinstance(value, str) and not _marker(value) and not value.startswith("$$")
    if is_text and _MARKER.search(value):
        yield path, value
    for key, inner in _items(value):
        yield from doubtful(inner, (*path, key))


def unclosed(value: Any, path: Path = ()) -> Iterator[tuple[Path, str]]:
    """Path and text of every marker that lacks its closing brace."""
    if isinstance(value, str) and _UNCLOSED.fullmatch(value):
        yield path, value
    for key, inner in _items(value):
        yield from unclosed(inner, (*path, key))


def entry_of(search: Search, values: Mapping[str, Any]) -> ConfigurationEntry:
    """The configuration entry of a parameter set.

    A dimension that no marker names sets the scenario parameter of its name.
    """
    parameters = merge_pairs(search.parameters or [])
    calls = [(call.name, call.parameters) for call in search.variations or []]
    named = {name for _, name in markers([parameters, [inner for _, inner in calls]])}
    direct = {name: value for name, value in values.items() if name not in named}
    merged = {**replaced(parameters, values), **direct}
    return ConfigurationEntry(
        name=f"c{set_id(values)}",
        parameters=[{name: value} for name, value in merged.items()],
        variations=[
            PluginCall(name=name, parameters=replaced(inner, values)) for name, inner in calls
        ]
        or None,
    )


def replaced(value: Any, values: Mapping[str, Any]) -> Any:
    """A template, or a part of it, with values in place of markers."""
    if isinstance(value, str):
        name = _marker(value)
        if name is not None:
            return deepcopy(values[name])
        return value[1:] if value.startswith("$$") else value
    if isinstance(value, dict):
        return {key: replaced(inner, values) for key, inner in value.items()}
    return [replaced(inner, values) for inner in value] if isinstance(value, list) else value


def _marker(text: str) -> str | None:
    match = _MARKER.fullmatch(text)
    return (match["plain"] or match["braced"]) if match else None


def _items(value: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(value, dict):
        yield from value.items()
    elif isinstance(value, list):
        yield from enumerate(value)
