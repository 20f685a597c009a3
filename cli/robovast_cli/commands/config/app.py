"""`vast config`: what a .vast file expands to, and what can be written in one."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.lazy import new_app

app = new_app("List, generate and check configurations.", no_args_is_help=True)


_DOCUMENTS = {".vast", ".yaml", ".yml"}


@app.callback()
def config() -> None:
    """List, generate and check configurations."""


@app.command("list")
def list_(
    ctx: typer.Context,
    output: Annotated[
        Literal["table", "name", "json", "yaml"],
        typer.Option("-o", "--output", help="How to print them."),
    ] = "table",
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="Also show keys that begin with `_`: the entry, files and variations of each "
            "configuration, and what variation types left for themselves.",
        ),
    ] = False,
) -> None:
    """List the configurations that will be run."""
    from robovast_cli.ui.listing import print_configurations

    print_configurations(ctx.obj.document(), output, internal=debug)


@app.command(hidden=True)
def gui(ctx: typer.Context, debug: Annotated[bool, typer.Option("--debug")] = False) -> None:
    """List the configurations, as `vast config list`: they are edited in an editor of your own."""
    from robovast_cli.ui.listing import print_configurations

    typer.echo(
        "note: `vast` has no editor for configurations. Use your own editor with the schema of "
        "`vast config schema`; `vast config view OUT` draws configurations. This is the output of "
        "`vast config list`.",
        err=True,
    )
    print_configurations(ctx.obj.document(), "table", internal=debug)


@app.command()
def generate(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="New or empty folder.")],
    keep_transient: Annotated[
        bool,
        typer.Option(
            "--keep-transient",
            help="Keep the work folder of the variation types as OUT/_transient/work, to see what "
            "they made on the way.",
        ),
    ] = False,
    no_cache: Annotated[
        bool,
        typer.Option(
            "--no-cache",
            help="Give the variation types an empty cache ($XDG_CACHE_HOME is a new folder), so "
            "that they make everything anew.",
        ),
    ] = False,
) -> None:
    """Write what a campaign has before its first run."""
    from robovast_cli.commands.config.generation import generate

    generate(ctx.obj.document(), out, keep_work=keep_transient, use_cache=not no_cache)


@app.command()
def view(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for the pictures.")],
    config: Annotated[
        list[str] | None,
        typer.Option(
            "--config",
            metavar="NAME|GLOB",
            help="Only these: a configuration, an entry, or a glob; may be repeated.",
            show_default=False,
        ),
    ] = None,
    format_: Annotated[
        Literal["svg", "png"], typer.Option("--format", help="Format of the pictures.")
    ] = "svg",
) -> None:
    """Draw each configuration: map, start, goals, path, obstacles."""
    from robovast_cli.commands.config.view import write_pictures

    write_pictures(ctx.obj.document(), config, out, format_)


@app.command()
def info(ctx: typer.Context) -> None:
    """Summarize what the .vast file runs, and how."""
    from robovast_cli.commands.config.info import print_summary

    print_summary(ctx.obj.document())


@app.command()
def check(ctx: typer.Context) -> None:
    """Check the .vast file, and say what of it has no effect."""
    from robovast_cli.commands.config.info import print_check

    print_check(ctx.obj.document(parse_scenario=False))


@app.command()
def schema() -> None:
    """Print the JSON Schema of .vast files, for editors."""
    from robovast.model.document.schema import schema_text

    typer.echo(schema_text(), nl=False)


@app.command()
def variation_types() -> None:
    """List the installed variation types and their parameters."""
    from robovast_cli.commands.config.info import print_variation_types

    print_variation_types()


@app.command()
def variation_points(ctx: typer.Context) -> None:
    """List the scenario parameters that variations can set."""
    from robovast_cli.commands.config.info import print_variation_points

    print_variation_points(ctx.obj.document())


@app.command()
def export_configs(
    ctx: typer.Context,
    patterns: Annotated[
        list[str],
        typer.Argument(
            metavar="PATTERN",
            help="Names or globs of configurations; the last may be the file to write (`*.vast`, "
            "`*.yaml`, `*.yml`).",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="File to write; stdout when omitted."),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--input", metavar="VAST_FILE", help="The same as `vast -V`.", show_default=False
        ),
    ] = None,
) -> None:
    """Write configurations as entries with fixed parameters.

    They can be imported into another .vast file, to run exactly these again.
    """
    from robovast_cli.commands.config.entries import export_entries

    if output is None and len(patterns) > 1 and Path(patterns[-1]).suffix in _DOCUMENTS:
        output = Path(patterns.pop())
    ctx.obj.vast_file = source or ctx.obj.vast_file
    export_entries(ctx.obj.document(), patterns, output)


@app.command()
def import_configs(
    ctx: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(metavar="SOURCE", help="Exported entries, a .vast file or a campaign."),
    ],
) -> None:
    """Add exported configurations to the .vast file.

    The text that is there stays as it is, comments included.
    """
    from robovast_cli.commands.config.entries import import_entries

    import_entries(ctx.obj.path, source)
