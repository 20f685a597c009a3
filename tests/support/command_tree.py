"""The commands of `vast`, as a tree."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robovast_cli.lazy import LazyCommand
from robovast_cli.main import command


def commands() -> Iterator[tuple[str, Any]]:
    """Every command and group without its aliases, by the words that call it."""
    root = command()
    root.plugins = {}  # those of this machine
    return _below(root, "")


def leaves() -> list[str]:
    """The words of each command that is no group."""
    return [path for path, real in commands() if not getattr(real, "commands", None)]


def _below(real: Any, path: str) -> Iterator[tuple[str, Any]]:
    real = real.load() if isinstance(real, LazyCommand) else real
    yield path, real
    for name, child in getattr(real, "commands", {}).items():
        if not child.hidden:
            yield from _below(child, f"{path} {name}".strip())
