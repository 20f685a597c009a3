"""`vast config`: list, generate and check configurations."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.lazy import examples, new_app

app = new_app("List, generate and check configurations.", no_args_is_help=True)


_DOCUMENTS = {".vast", ".yaml", ".yml"}


@app.callback()
def config() -> None:
    """List, generate and check configurations."""


@app.command("list")
@examples(
    ("vast -V robot.vast config list", "Print a table"),
    ("vast -V robot.vast config list -o json", "Print JSON"),
)
def list_(
    ctx: typer.Context,
    output: Annotated[
        Literal["table", "name", "json", "yaml"],
        typer.Option("-o", "--output", help="Output format."),
    ] = "table",
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="Also show keys that start with `_`: entry, files and variations of each "
            "configuration, and internal values of variation types.",
        ),
    ] = False,
) -> None:
    """List the configurations of the .vast file."""
    from robovast_cli.ui.listing import print_configurations

    print_configurations(ctx.obj.document(), output, internal=debug)


@app.command(hidden=True)
def gui(ctx: typer.Context, debug: Annotated[bool, typer.Option("--debug")] = False) -> None:
    """List the configurations, as `vast config list`: RoboVAST has no built-in editor."""
    from robovast_cli.ui.listing import print_configurations

    typer.echo(
        "note: `vast` has no editor for configurations. Use your own editor with the schema of "
        "`vast config schema`, or draw configurations with `vast config view OUT`. The output "
        "below comes from `vast config list`.",
        err=True,
    )
    print_configurations(ctx.obj.document(), "table", internal=debug)


@app.command()
@examples(
    ("vast config generate inputs", "Write all inputs to the folder inputs"),
    ("vast config generate inputs --no-cache", "Do not use cached files"),
)
def generate(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="New or empty folder.")],
    keep_transient: Annotated[
        bool,
        typer.Option(
            "--keep-transient",
            help="Keep intermediate files of the variation types in OUT/_transient/work.",
        ),
    ] = False,
    no_cache: Annotated[
        bool,
        typer.Option(
            "--no-cache",
            help="Use an empty cache ($XDG_CACHE_HOME is a new folder), so that variation types "
            "create all files again.",
        ),
    ] = False,
) -> None:
    """Generate all inputs of a campaign without running them."""
    from robovast_cli.commands.config.generation import generate

    generate(ctx.obj.document(), out, keep_work=keep_transient, use_cache=not no_cache)


@app.command()
@examples(
    ("vast config view drawings", "Draw all configurations"),
    ("vast config view drawings -c 'hall-*' --format png", "Draw a selection as PNG"),
)
def view(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for the images.")],
    config: Annotated[
        list[str] | None,
        typer.Option(
            "-c",
            "--config",
            metavar="NAME|GLOB",
            help="Select configurations by name, entry or glob (repeatable).",
            show_default=False,
        ),
    ] = None,
    format_: Annotated[
        Literal["svg", "png"], typer.Option("--format", help="Image format.")
    ] = "svg",
) -> None:
    """Draw the map, start, goals, path and obstacles of configurations."""
    from robovast_cli.commands.config.view import write_pictures

    write_pictures(ctx.obj.document(), config, out, format_)


@app.command()
@examples(
    ("vast config info", "Summarize the .vast file of the project"),
    ("vast -V robot.vast config info", "Summarize robot.vast"),
)
def info(ctx: typer.Context) -> None:
    """Summarize the campaign that the .vast file describes."""
    from robovast_cli.commands.config.info import print_summary

    print_summary(ctx.obj.document())


@app.command()
@examples(
    ("vast config check", "Check the .vast file of the project"),
    ("vast -V robot.vast config check", "Check robot.vast"),
)
def check(ctx: typer.Context) -> None:
    """Check the .vast file, and warn about keys without effect.

    Also lists differences from the original RoboVAST that affect the file.
    """
    from robovast_cli.commands.config.info import print_check

    print_check(ctx.obj.document(parse_scenario=False))


@app.command()
@examples(
    ("vast config schema", "Print the schema"),
    ("vast config schema > vast.schema.json", "Write the schema to a file"),
)
def schema() -> None:
    """Print the JSON Schema of .vast files, for editors."""
    from robovast.model.document.schema import schema_text

    typer.echo(schema_text(), nl=False)


@app.command()
@examples(
    ("vast config variation-types", "List all types with their parameters"),
    ("vast config variation-types | less", "Show the list page by page"),
)
def variation_types() -> None:
    """List the installed variation types and their parameters."""
    from robovast_cli.commands.config.info import print_variation_types

    print_variation_types()


@app.command()
@examples(
    ("vast config variation-points", "List parameters of the project's scenario"),
    ("vast -V robot.vast config variation-points", "List parameters of the scenario of robot.vast"),
)
def variation_points(ctx: typer.Context) -> None:
    """List the scenario parameters that variations can set."""
    from robovast_cli.commands.config.info import print_variation_points

    print_variation_points(ctx.obj.document())


@app.command()
@examples(
    ("vast config export-configs hall-3 failed.yaml", "Export one configuration to a file"),
    ("vast config export-configs 'hall-*' -o failed.yaml", "Export a selection"),
)
def export_configs(
    ctx: typer.Context,
    patterns: Annotated[
        list[str],
        typer.Argument(
            metavar="PATTERN",
            help="Names or globs of configurations. The last one may be the output file "
            "(`*.vast`, `*.yaml`, `*.yml`).",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Output file (default: stdout)."),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option("--input", metavar="VAST_FILE", help="Same as `vast -V`.", show_default=False),
    ] = None,
) -> None:
    """Export configurations with fixed parameters.

    `vast config import-configs` adds them to another .vast file, in order to run them again.
    """
    from robovast_cli.commands.config.entries import export_entries

    if output is None and len(patterns) > 1 and Path(patterns[-1]).suffix in _DOCUMENTS:
        output = Path(patterns.pop())
    ctx.obj.vast_file = source or ctx.obj.vast_file
    export_entries(ctx.obj.document(), patterns, output)


@app.command()
@examples(
    ("vast -V robot.vast config import-configs failed.yaml", "Add exported configurations"),
    ("vast config import-configs results/hall-2026-03-04-152130", "Add its configurations"),
)
def import_configs(
    ctx: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE", help="Exported configurations, a .vast file or a campaign."
        ),
    ],
) -> None:
    """Add exported configurations to the .vast file.

    Existing text and comments are not modified.
    """
    from robovast_cli.commands.config.entries import import_entries

    import_entries(ctx.obj.path, source)
