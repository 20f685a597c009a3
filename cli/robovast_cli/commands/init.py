"""`vast init`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast.model.project import create_project
from robovast_cli.lazy import examples
from robovast_cli.workspace import shown


@examples(
    ("vast init robot.vast", "Use robot.vast in this folder and below"),
    ("vast init robot.vast -r /data/results --force", "Replace the project file"),
)
def init(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The .vast file.")],
    results_dir: Annotated[
        Path,
        typer.Option(
            "-r", "--results-dir", metavar="PATH", help="Folder for campaigns and their results."
        ),
    ] = Path("results"),
    log_level: Annotated[
        Literal["debug", "info", "warning", "error", "critical"] | None,
        typer.Option(
            "--project-log-level",
            case_sensitive=False,
            help="Log level of all commands in this project (default: warning).",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace an existing project file.")
    ] = False,
) -> None:
    """Create a project file that names the .vast file.

    Commands in this folder and below use the .vast file and the results folder of the project.
    """
    path = create_project(Path.cwd(), config, results_dir, log_level, force=force)
    typer.echo(f"Project file {shown(path)}: {shown(config)}, results in {shown(results_dir)}.")
    typer.echo(
        "Next: `vast config list` lists the configurations, `vast exec local run` runs them."
    )
