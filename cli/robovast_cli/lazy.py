"""Typer apps whose commands are imported when they are used: `--help` shows them without.

docs/contributing/style.md has the form of a command's help. The first line of the docstring is the
summary and equals the line in the table of its group. `examples` adds at least two examples:

    @app.command(epilog="Exit codes: 0 all passed · 1 a run failed")
    @examples(
        ("vast view results/hall-2026-03-04-152130/hall-1/0", "Play a run"),
        ("vast view results/hall-2026-03-04-152130/hall-1/0 -p 8000", "Use port 8000"),
    )
    def view(...) -> None:
        ...  # with a docstring
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import cleandoc
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from robovast_cli.ui.usage import name_values, normalize_paths, refuse_contexts

WIDTH = 96
"""Columns of a line in the help of a command."""

AnyFunction = TypeVar("AnyFunction", bound=Callable[..., Any])


@dataclass(frozen=True)
class Lazy:
    """A command or group in a module of its own."""

    target: str
    """`module:app`, where `app` is a Typer app."""
    help: str
    """Line in the help of the group above."""
    aliases: tuple[str, ...] = ()
    """Further names, not shown in the help."""
    section: str = "Commands"
    """Heading in the help of the group above."""


class LazyCommand(TyperCommand):
    """Stands for a command until it is used."""

    def __init__(self, name: str, entry: Lazy, *, hidden: bool = False) -> None:
        super().__init__(name, help=entry.help, short_help=entry.help, hidden=hidden)
        self._target = entry.target

    def load(self) -> Any:
        """The command itself."""
        module, _, attribute = self._target.partition(":")
        command = get_command(getattr(import_module(module), attribute))
        return refuse_contexts(normalize_paths(name_values(command)))

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """The context of the real command, which replaces this one."""
        return self.load().make_context(info_name, args, parent=parent, **extra)


def paths_of(name: str, group: Any, path: str) -> Iterator[str]:
    """Commands of a name anywhere below a group, as one types them: `vast exec local run`."""
    for own, command in getattr(group, "commands", {}).items():
        if command.hidden:
            continue
        if own == name:
            yield f"`{path} {own}`"
        real = command.load() if isinstance(command, LazyCommand) else command
        yield from paths_of(name, real, f"{path} {own}")


def examples(*lines: tuple[str, str]) -> Callable[[AnyFunction], AnyFunction]:
    """Add examples to the help of a command, which keeps their line breaks.

    Args:
        lines: commands and their effects. Write it below `@app.command()`.
    """
    column = max(len(call) for call, _ in lines) + 2
    if any(column + len(effect) + 2 > WIDTH for _, effect in lines):
        texts = [f"  {effect}:\n    {call}" for call, effect in lines]
    else:
        texts = [f"  {call:{column}}{effect}" for call, effect in lines]
    block = "\n".join(["\b", "Examples:", *texts])

    def add(command: AnyFunction) -> AnyFunction:
        command.__doc__ = f"{cleandoc(command.__doc__ or '')}\n\n{block}"
        return command

    return add


def new_app(help_text: str, **settings: Any) -> typer.Typer:
    """A Typer app that looks like every other of this tool."""
    common: dict[str, Any] = {
        "add_completion": False,
        "rich_markup_mode": None,
        "pretty_exceptions_enable": False,
        "context_settings": {"help_option_names": ["-h", "--help"], "max_content_width": 100},
    }
    return typer.Typer(help=help_text, **{**common, **settings})


def new_group(help_text: str, table: Mapping[str, Lazy]) -> typer.Typer:
    """A Typer app made of lazy commands alone."""

    class Group(TyperGroup):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**attributes)
            add_lazy(self, table)

        def format_commands(self, ctx: Any, formatter: Any) -> None:
            """List the commands below the headings of the table."""
            del ctx
            column = max(map(len, table))
            for heading in dict.fromkeys(entry.section for entry in table.values()):
                rows = [(f"{n:{column}}", e.help) for n, e in table.items() if e.section == heading]
                with formatter.section(heading):
                    formatter.write_dl(rows)

    app = new_app(help_text, cls=Group, no_args_is_help=True)
    app.callback()(_nothing)
    return app


def _nothing() -> None:
    """A group does nothing by itself."""


def add_lazy(group: TyperGroup, table: Mapping[str, Lazy]) -> None:
    """Add the commands of a table, each under its short name and its aliases."""
    for name, entry in table.items():
        group.add_command(LazyCommand(name, entry))
        for alias in entry.aliases:
            group.add_command(LazyCommand(alias, entry, hidden=True))
