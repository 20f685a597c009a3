"""The command `vast`: its global options and its table of commands."""

import logging
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup
from typer.main import get_command

from robovast.base.printable import PrintableFormatter
from robovast_cli import conflicting_package
from robovast_cli.lazy import Lazy, add_lazy, find_commands, new_app
from robovast_cli.ui.report import echo_stderr, report_errors
from robovast_cli.ui.usage import UsageError, explain_usage_errors, normalize_paths
from robovast_cli.workspace import Workspace, set_log_level

COMMANDS: Mapping[str, Lazy] = {
    "init": Lazy("init", "Create a project file that names the .vast file."),
    "config": Lazy(
        "config.app:app", "List, generate and check configurations.", aliases=("configuration",)
    ),
    "exec": Lazy("exec.app:app", "Run campaigns.", aliases=("execution",)),
    "replay": Lazy("replay", "Run a stored run again and compare the results."),
    "minimise": Lazy("minimise", "Reduce the parameters of a failed run."),
    "results": Lazy("results.app:app", "Download, process, analyze and share results."),
    "evaluation": Lazy(
        "evaluation.app:app", "Browse results in the web UI and in notebooks.", aliases=("eval",)
    ),
    "view": Lazy("view", "Play back the recording of a run."),
    "mcp": Lazy("mcp", "Start an MCP server for AI assistants."),
    "import-results": Lazy("results.import_results", "Import a campaign from an archive."),
    "install-completion": Lazy(
        "completion:install_completion", "Install command completion for your shell."
    ),
}
"""Commands and groups of `vast`; another command needs one line here and a module."""


class Root(TyperGroup):
    """The root group, with the commands of plugins; reports all errors."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        add_lazy(self, "robovast_cli.commands", COMMANDS)

    @cached_property
    def plugins(self) -> Mapping[str, Any]:
        """Commands of plugins by name."""
        from robovast_cli.plugins import echo_warning, find_plugins

        return find_plugins(self.commands, echo_warning)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands, plugins last."""
        return [*super().list_commands(ctx), *self.plugins]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by name, also of plugins."""
        return super().get_command(ctx, cmd_name) or self.plugins.get(cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the called command; the error for an unknown name lists commands of groups."""
        try:
            return super().resolve_command(ctx, args)
        except typer.TyperException:
            if found := sorted(find_commands(args[0], self, "vast")):
                message, hint = f"no such command {args[0]!r}", f"did you mean {', '.join(found)}?"
                raise UsageError(message, ctx, hint=hint) from None
            raise

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """Parse the global options."""
        with explain_usage_errors(), report_errors():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> Any:
        """Run a command, which returns the exit code."""
        with explain_usage_errors(), report_errors():
            code = super().invoke(ctx)
        raise typer.Exit(int(code or 0))


app = new_app(
    "Run robot scenarios in many variations and analyze their failures.",
    cls=Root,
    no_args_is_help=True,
    add_completion=True,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from robovast.base.version import __version__

        typer.echo(f"vast {__version__}")
        raise typer.Exit


@app.callback()
def vast(
    ctx: typer.Context,
    log_level: Annotated[
        Literal["debug", "info", "warning", "error", "critical"] | None,
        typer.Option(
            "-l",
            "--log-level",
            case_sensitive=False,
            help="Verbosity on stderr (default: from the project, else warning).",
        ),
    ] = None,
    vast_file: Annotated[
        Path | None,
        typer.Option(
            "-V",
            "--vast-file",
            metavar="PATH",
            help="The .vast file (default: from the project, else the only *.vast here).",
        ),
    ] = None,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Set the global options."""
    del version  # handled by its callback
    logging.basicConfig(format="%(levelname)s: %(message)s")
    for handler in logging.getLogger().handlers:
        handler.setFormatter(PrintableFormatter("%(levelname)s: %(message)s"))
    set_log_level(log_level or "warning")
    ctx.obj = Workspace(vast_file, log_level)


def command() -> Any:
    """Return the root command."""
    root = get_command(app)  # registers the shells with completion
    own = {"install_completion", "show_completion"}  # replaced by `vast install-completion`
    root.params = [param for param in root.params if param.name not in own]
    return normalize_paths(root)


def main() -> None:
    """Run `vast` with the arguments of the process; exits with a code of `ExitCode`."""
    if found := conflicting_package.conflict_warning():
        echo_stderr(found)
    command()(prog_name="vast")
