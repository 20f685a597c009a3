"""The part of docs/cli.md that is generated: the help of every command."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer
from typer.core import TyperGroup

from robovast_cli.lazy import LazyCommand
from robovast_cli.main import command

BEGIN = "<!-- begin of what scripts/generate writes -->"
END = "<!-- end of what scripts/generate writes -->"

WIDTH = 100


def with_reference(page: str) -> str:
    """A page with the help of every command between its two markers."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    return "".join([before, begin, "\n\n", *_sections(), end, after])


def _sections() -> Iterator[str]:
    root = command()
    root.plugins = {}  # those of this machine are no part of the page
    for path, text in _help(root, "vast", None):
        yield f"### {path}\n\n```text\n{text}\n```\n\n"


def _help(cmd: Any, name: str, parent: typer.Context | None) -> Iterator[tuple[str, str]]:
    real = cmd.load() if isinstance(cmd, LazyCommand) else cmd
    settings = {**real.context_settings, "terminal_width": WIDTH}
    ctx = typer.Context(real, info_name=name, parent=parent, **settings)
    yield ctx.command_path, real.get_help(ctx)
    for child_name, child in real.commands.items() if isinstance(real, TyperGroup) else ():
        if not child.hidden:
            yield from _help(child, child_name, ctx)
