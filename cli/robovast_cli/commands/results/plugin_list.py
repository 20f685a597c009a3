"""Lists the installed plugins of a group and their parameters."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Collection, Iterator
from importlib.metadata import EntryPoint
from typing import Any

from robovast.base.plugins import plugins_of
from robovast_cli.plugins import origin
from robovast_cli.ui.table import format_table

_ARGUMENTS = re.compile(r"^Args:\n(?P<items>(?: .*\n?|\n(?= ))+)", re.MULTILINE)
_ARGUMENT = re.compile(r"^ {4}(\w+)(?: \([^)]*\))?: (.*(?:\n {5,}.*)*)", re.MULTILINE)


def describe_plugins(group: str, reserved: Collection[str]) -> str:
    """Return a list of the plugins of a group, with errors for plugins that cannot be loaded.

    Args:
        group: entry-point group.
        reserved: names of parameters that a .vast file cannot set.
    """
    points = sorted(plugins_of(group).values(), key=lambda point: point.name)
    return "\n\n".join("\n".join(_describe_plugin(point, reserved)) for point in points)


def _describe_plugin(point: EntryPoint, reserved: Collection[str]) -> Iterator[str]:
    try:
        plugin = point.load()
    except Exception as error:  # a plugin's code may raise anything
        yield f"{point.name}  (cannot be loaded: {type(error).__name__}: {error})"
        return
    yield f"{point.name}  ({origin(point)})"
    about = inspect.getdoc(plugin) or ""
    yield f"    {_one_line(about.partition(chr(10) * 2)[0])}".rstrip()
    texts = _describe_arguments(about) | _describe_arguments(inspect.getdoc(_call(plugin)) or "")
    rows = [
        [f"    {name}", _default(parameter.default), texts.get(name, "")]
        for name, parameter in _parameters(plugin, reserved).items()
    ]
    if rows:
        yield format_table(["", "", ""], rows).strip("\n")


def _default(value: Any) -> str:
    """Return a default value as written in a .vast file."""
    if value is inspect.Parameter.empty:
        return "required"
    if value is None:
        return "default none"
    plain = list(value) if isinstance(value, tuple | frozenset) else value
    return f"default {json.dumps(plain, default=str, ensure_ascii=False)}"


def _describe_arguments(docstring: str) -> dict[str, str]:
    """Return the descriptions of arguments in a docstring."""
    arguments = _ARGUMENTS.search(docstring)
    items = _ARGUMENT.findall(arguments["items"]) if arguments else []
    return {name: _one_line(text) for name, text in items}


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _call(plugin: Any) -> Any:
    return plugin if inspect.isfunction(plugin) else plugin.__call__


def _parameters(plugin: Any, reserved: Collection[str]) -> dict[str, inspect.Parameter]:
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {
        name: parameter
        for name, parameter in inspect.signature(_call(plugin)).parameters.items()
        if name not in {*reserved, "self"} and parameter.kind in kinds
    }
