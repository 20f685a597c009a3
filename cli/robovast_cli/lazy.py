"""Typer apps whose commands are imported when they are used, not by `--help` of their group.

docs/contributing/style.md has the form of a command's help. The first line of the docstring is the
summary and equals the line in the table of its group. `examples` adds at least two examples:

    @exit_codes("0 all passed · 1 a run failed")
    @examples(
        ("vast view results/hall-2026-03-04-152130/hall-1/0", "Play a run"),
        ("vast view results/hall-2026-03-04-152130/hall-1/0 -p 8000", "Use port 8000")
    )
    def view(...) -> int | None:
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

from robovast_cli.ui.usage import name_parameters, normalize_paths, reject_second_context

WIDTH = 96
"""Columns of a line in the help of a command."""

AnyFunction = TypeVar("AnyFunction", bound=Callable[..., Any])


@dataclass(frozen=True)
class Lazy:
    """A command or group, imported when it is used."""

    target: str
    """Module of a command, below the package of the group above. `module:name` names the function
    of the command (default: as the command), or the Typer app of a group."""
    help: str
    """Line in the help of the group above."""
    aliases: tuple[str, ...] = ()
    """Further names, not shown in the help."""
    section: str = "Commands"
    """Heading in the help of the group above."""
    hidden: bool = False
    """Whether the help of the group above omits it."""


class LazyCommand(TyperCommand):
    """Represents a command until it is used."""

    def __init__(self, name: str, entry: Lazy, target: str, *, hidden: bool) -> None:
        super().__init__(name, help=entry.help, short_help=entry.help, hidden=hidden)
        self._target = target

    def load(self) -> Any:
        """Import the command."""
        module, _, name = self._target.partition(":")
        found = getattr(import_module(module), name)
        command = get_command(found if isinstance(found, typer.Typer) else _app_of(found))
        return reject_second_context(normalize_paths(name_parameters(command)))

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """Return the context of the imported command."""
        return self.load().make_context(info_name, args, parent=parent, **extra)


def _app_of(function: Callable[..., Any]) -> typer.Typer:
    app = new_app("")
    app.command(epilog=getattr(function, "epilog", None))(function)
    return app


def find_commands(name: str, group: Any, path: str) -> Iterator[str]:
    """Yield the commands with a name anywhere below a group, such as `vast exec local run`."""
    for own, command in getattr(group, "commands", {}).items():
        if command.hidden:
            continue
        if own == name:
            yield f"`{path} {own}`"
        real = command.load() if isinstance(command, LazyCommand) else command
        yield from find_commands(name, real, f"{path} {own}")


def examples(*lines: tuple[str, str]) -> Callable[[AnyFunction], AnyFunction]:
    """Add examples, commands and their effects, to the help of a command."""
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


def exit_codes(text: str) -> Callable[[AnyFunction], AnyFunction]:
    """Add a line with the exit codes to the end of the help of a command."""

    def add(command: AnyFunction) -> AnyFunction:
        command.epilog = f"Exit codes: {text}"  # type: ignore[attr-defined]
        return command

    return add


def new_app(help_text: str, **settings: Any) -> typer.Typer:
    """Return a Typer app with the settings of all apps of `vast`."""
    common: dict[str, Any] = {
        "add_completion": False,
        "rich_markup_mode": None,
        "pretty_exceptions_enable": False,
        "context_settings": {"help_option_names": ["-h", "--help"], "max_content_width": 100},
    }
    return typer.Typer(help=help_text, **{**common, **settings})


def new_group(help_text: str, package: str, table: Mapping[str, Lazy]) -> typer.Typer:
    """Return a Typer app that has only lazy commands, whose modules are in a package."""

    class Group(TyperGroup):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**attributes)
            add_lazy(self, package, table)

        def format_commands(self, ctx: Any, formatter: Any) -> None:
            """List the commands below the headings of the table."""
            del ctx
            shown = {name: entry for name, entry in table.items() if not entry.hidden}
            column = max(map(len, shown))
            for heading in dict.fromkeys(entry.section for entry in shown.values()):
                rows = [(f"{n:{column}}", e.help) for n, e in shown.items() if e.section == heading]
                with formatter.section(heading):
                    formatter.write_dl(rows)

    app = new_app(help_text, cls=Group, no_args_is_help=True)
    app.callback()(_nothing)
    return app


def _nothing() -> None:
    """Do nothing, because a group only has commands."""


def add_lazy(group: TyperGroup, package: str, table: Mapping[str, Lazy]) -> None:
    """Add the commands of a table, each under its short name and its aliases."""
    for name, entry in table.items():
        module, _, own = entry.target.partition(":")
        target = f"{package}.{module}:{own or name.replace('-', '_')}"
        group.add_command(LazyCommand(name, entry, target, hidden=entry.hidden))
        for alias in entry.aliases:
            group.add_command(LazyCommand(alias, entry, target, hidden=True))
