"""`vast init`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast.model.project import create_project
from robovast_cli.lazy import new_app
from robovast_cli.workspace import shown

app = new_app("Make the working directory a project: its commands know their .vast file.")


@app.command()
def init(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The .vast file.")],
    results_dir: Annotated[
        Path,
        typer.Option(
            "-r", "--results-dir", metavar="PATH", help="Where campaigns and their results go."
        ),
    ] = Path("results"),
    log_level: Annotated[
        Literal["debug", "info", "warning", "error", "critical"] | None,
        typer.Option(
            "--project-log-level",
            case_sensitive=False,
            help="Log level of every command in this project.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace an existing project file.")
    ] = False,
) -> None:
    """Make the working directory a project: commands in it and below know their .vast file."""
    path = create_project(Path.cwd(), config, results_dir, log_level, force=force)
    typer.echo(f"Project file {shown(path)}: {shown(config)}, results in {shown(results_dir)}.")
    typer.echo("Next: `vast config list` shows what will run, `vast exec local run` runs it.")
