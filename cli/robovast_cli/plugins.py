"""Commands of other distributions: entry points of `robovast.cli_plugins` and `vast.plugins`.

A plugin is a Click command or group, or a Typer app. Its code is imported when its command is
used, never for the help of `vast`. Invalid plugins are reported and skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any

import typer
from typer.core import TyperCommand
from typer.main import get_command

from robovast.base.errors import CannotRunError
from robovast_cli.ui.report import echo_stderr

GROUPS = ("robovast.cli_plugins", "vast.plugins")


class PluginCommand(TyperCommand):
    """Represents the command of a plugin, which receives the rest of the command line."""

    def __init__(self, entry: EntryPoint) -> None:
        line = f"Plugin of {origin(entry)}."
        super().__init__(entry.name, help=line, short_help=line, add_help_option=False)
        self._entry = entry

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Pass all arguments to the plugin."""
        ctx.args = list(args)
        return args

    def invoke(self, ctx: Any) -> Any:
        """Run the plugin, which reports its usage errors itself."""
        command = load_plugin(self._entry)
        return command.main(args=ctx.args, prog_name=ctx.command_path, standalone_mode=True)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """The plugin's object, if it is a Click command."""
        try:
            from click.shell_completion import ShellComplete  # installed if the plugin uses Click

            shell = ShellComplete(load_plugin(self._entry), {}, "", "")
            return list(shell.get_completions(ctx.args, incomplete))
        except Exception:
            return []  # the shell cannot show an error


def load_plugin(entry: EntryPoint) -> Any:
    """Return the Click command of an entry point.

    Raises:
        CannotRunError: it cannot be imported, or is not a command.
    """
    try:
        plugin = entry.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a plugin may exit during its import
        raise CannotRunError(
            f"{_describe(entry)} cannot be loaded from `{entry.value}`: {type(error).__name__}: "
            f"{error}",
            hint="update or remove that distribution",
        ) from error
    if isinstance(plugin, typer.Typer):
        return get_command(plugin)
    if not isinstance(plugin, type) and callable(getattr(plugin, "main", None)):
        return plugin
    raise CannotRunError(
        f"{_describe(entry)} names `{entry.value}`, a {type(plugin).__name__}; it must be a Click "
        "command or group, or a Typer app.",
        hint="update or remove that distribution",
    )


def find_plugins(taken: Iterable[str], report: Callable[[str], None]) -> dict[str, PluginCommand]:
    """Return the commands of plugins by name.

    Args:
        taken: names that plugins cannot use.
        report: function that is called with a line for each skipped plugin.
    """
    found: dict[str, EntryPoint] = {}
    for entry in (entry for group in GROUPS for entry in entry_points(group=group)):
        problem = _problem(entry, found.get(entry.name), taken)
        if problem:
            report(f"{_describe(entry)} is skipped: {problem}")
        else:
            found.setdefault(entry.name, entry)
    return {name: PluginCommand(entry) for name, entry in sorted(found.items())}


def echo_warning(line: str) -> None:
    """Print a warning."""
    echo_stderr(f"warning: {line}")


def _problem(entry: EntryPoint, other: EntryPoint | None, taken: Iterable[str]) -> str | None:
    if entry.name in taken:
        return "`vast` has a command of that name"
    if other is not None and other.value != entry.value:
        return f"{origin(other)} also has a plugin of that name"
    if not EntryPoint.pattern.match(entry.value):
        return f"`{entry.value}` is not of the form `package.module:command`"
    try:
        package = entry.module.partition(".")[0]
        if find_spec(package) is None:
            return f"the module `{package}` does not exist"
    except (ImportError, ValueError):
        return f"`{entry.value}` is not of the form `package.module:command`"
    return None


def _describe(entry: EntryPoint) -> str:
    return f"the command `{entry.name}` of {origin(entry)}"


def origin(entry: EntryPoint) -> str:
    """Name and version of the distribution that an entry point comes from."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown distribution"
