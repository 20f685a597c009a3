"""What plugins of a group are installed, and how a .vast file calls them."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterator
from importlib.metadata import EntryPoint
from typing import Any

from robovast.base.plugins import plugins_of
from robovast_cli.plugins import origin


def described_plugins(group: str, given: Collection[str]) -> str:
    """Every installed plugin of a group; one that cannot be loaded says why.

    Args:
        group: entry-point group.
        given: parameters that no .vast file sets.
    """
    points = sorted(plugins_of(group).values(), key=lambda point: point.name)
    return "\n\n".join("\n".join(_described(point, given)) for point in points)


def _described(point: EntryPoint, given: Collection[str]) -> Iterator[str]:
    try:
        plugin = point.load()
    except Exception as error:  # a plugin's code may raise anything
        yield f"{point.name}  (cannot be loaded: {type(error).__name__}: {error})"
        return
    yield f"{point.name}  ({origin(point)})"
    about = inspect.getdoc(plugin) or ""
    yield f"    {about.partition(chr(10) * 2)[0].replace(chr(10), ' ')}".rstrip()
    for name, parameter in _parameters(plugin, given).items():
        required = parameter.default is inspect.Parameter.empty
        yield f"    {name}: " + ("required" if required else f"{parameter.default!r} when omitted")


def _parameters(plugin: Any, given: Collection[str]) -> dict[str, inspect.Parameter]:
    call = plugin.__call__ if inspect.isclass(plugin) else plugin
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {
        name: parameter
        for name, parameter in inspect.signature(call).parameters.items()
        if name not in {*given, "self"} and parameter.kind in kinds
    }
