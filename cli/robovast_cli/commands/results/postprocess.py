"""`vast results postprocess` and `vast results postprocess-commands`."""

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Turn raw results into tables, metadata and a provenance graph.")
commands_app = new_app("List the installed postprocessing commands and their parameters.")


@app.command()
def postprocess(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Do everything again, changed or not.")
    ] = False,
    override: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--override",
            metavar="VAST_FILE",
            help="Use the commands of this file for every campaign, not those that each holds.",
            show_default=False,
        ),
    ] = None,
    skip: Annotated[
        list[str] | None,
        typer.Option("--skip", metavar="PLUGIN", help="Leave out this command; repeatable."),
    ] = None,
    skip_rosout: Annotated[
        bool, typer.Option("--skip-rosout", help="Leave out the conversion of ROS logs.")
    ] = False,
    skip_db: Annotated[
        bool,
        typer.Option(
            "--skip-db",
            help="Write no tables of the campaign: tables.duckdb, data.db, campaign.db.",
        ),
    ] = False,
    skip_metadata: Annotated[
        bool,
        typer.Option("--skip-metadata", help="Write neither metadata.yaml nor metadata.prov.json."),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            min=1,
            help="Runs side by side; as many as there are CPUs when omitted.",
            show_default=False,
        ),
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            metavar="SECONDS",
            min=0.1,
            help="Stop a command that takes longer for a run, or for a campaign as a whole.",
        ),
    ] = 3600.0,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show what commands print, and where they fail.")
    ] = False,
) -> int:
    """Turn raw results into tables, metadata and a provenance graph.

    Only what changed is worked again. Exit code 0: every command succeeded; 1: one did not; 2: a
    .vast file is wrong; 5: results cannot be written; 130: interrupted.
    """
    from robovast.analysis.postprocessing.events import Options
    from robovast_cli.commands.results.postprocessing import run

    options = Options(
        override=override,
        force=force,
        skip=tuple(skip or ()),
        skip_rosout=skip_rosout,
        skip_tables=skip_db,
        skip_metadata=skip_metadata,
        jobs=jobs,
        time_limit=time_limit,
        debug=debug,
    )
    return run(results_dir or ctx.obj.results, options)


@commands_app.command()
def postprocess_commands() -> None:
    """List the installed postprocessing commands and their parameters."""
    from robovast_cli.commands.results.postprocessing import print_commands

    print_commands()
