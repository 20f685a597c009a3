"""Recognizes `.vast` files of the original RoboVAST 2.x, whose format differs from version 1."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robovast.base.errors import Problem
from robovast.model.document.source import Source

_VERSIONS = (2, 3, 4)
_COUNTERPARTS = {
    "containers": "`execution.image` and `execution.secondary_containers`, which share one image",
    "plugins": "`file.py:Class` next to the .vast file, or packages in your image",
    "ros_packages": "an image that you build, named by `execution.image`",
    "python_packages": "an image that you build, named by `execution.image`",
    "system_packages": "an image that you build, named by `execution.image`",
    "scenario": "`parameters` and `variations` of an entry of `configuration`",
    "sizing": "`execution.resources`, and `execution.runs_per_job: auto`",
}
"""Keys of versions 2 to 4, with what has the same purpose in version 1."""
_ALONE = frozenset({"backend", "configuration_presets", "extends", "generate", "sim", "sut", "use"})
"""Keys without a counterpart."""


def problem_of(source: Source) -> Problem | None:
    """Return the problem of a file of version 2 to 4, None for any other document."""
    version = source.data.get("version")
    if str(version) not in map(str, _VERSIONS):
        return None
    found = dict.fromkeys(_keys(source.data))
    has = [f"    `{key}`: {_COUNTERPARTS[key]}" for key in found if key in _COUNTERPARTS]
    lacks = [f"`{key}`" for key in found if key in _ALONE]
    lines = [
        *(["Its keys that have a counterpart in version 1:", *has] if has else []),
        *([f"Its keys without a counterpart: {', '.join(lacks)}."] if lacks else []),
        "docs/how-to/migrate.md explains the differences and who should use which tool.",
    ]
    return source.problem(
        ("version",),
        f"version {version} is a format of the original RoboVAST 2.x, which is another tool; this "
        "tool reads version 1",
        "\n    ".join(lines),
    )


def _keys(data: Any) -> Iterator[str]:
    """The keys of a document at any depth, parents first, without the names of containers."""
    rest = [data]
    for value in rest:
        if isinstance(value, dict):
            yield from map(str, value)
            containers = value.get("containers")
            rest.extend(inner for inner in value.values() if inner is not containers)
            rest.extend(containers.values() if isinstance(containers, dict) else ())
        elif isinstance(value, list):
            rest.extend(value)
