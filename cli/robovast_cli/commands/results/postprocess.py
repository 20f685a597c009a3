"""`vast results postprocess` and `vast results postprocess-commands`."""

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples, exit_codes


@exit_codes(
    "0 all commands succeeded · 1 a command failed · 2 invalid .vast file · "
    "5 results cannot be written · 130 interrupted"
)
@examples(
    ("vast results postprocess", "Process all campaigns"),
    ("vast results postprocess -r results/hall-2026-03-04-152130 -f", "Process one again"),
    ("vast results postprocess --skip rosbags_to_csv --skip-rosout", "Skip commands"),
)
def postprocess(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Process unchanged results again.")
    ] = False,
    override: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--override",
            metavar="VAST_FILE",
            help="File whose commands replace the commands of each campaign.",
            show_default=False,
        ),
    ] = None,
    skip: Annotated[
        list[str] | None,
        typer.Option("--skip", metavar="PLUGIN", help="Command to skip (repeatable)."),
    ] = None,
    skip_rosout: Annotated[
        bool, typer.Option("--skip-rosout", help="Skip the conversion of ROS logs.")
    ] = False,
    skip_db: Annotated[
        bool,
        typer.Option(
            "--skip-db",
            help="Skip the tables of the campaign: tables.duckdb, data.db, campaign.db.",
        ),
    ] = False,
    skip_metadata: Annotated[
        bool,
        typer.Option("--skip-metadata", help="Skip metadata.yaml and metadata.prov.json."),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            min=1,
            help="Number of runs processed in parallel (default: number of CPUs).",
            show_default=False,
        ),
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            metavar="SECONDS",
            min=0.1,
            help="Time limit of a command in seconds, for a run or for a whole campaign.",
        ),
    ] = 3600.0,
    debug: Annotated[
        bool, typer.Option("--debug", help="Output of commands, with tracebacks.")
    ] = False,
) -> int:
    """Convert raw results into tables, metadata and a provenance graph.

    The commands are in `results_processing.postprocessing` of the .vast file. Unchanged results are
    skipped.
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


@examples(
    ("vast results postprocess-commands", "List the commands"),
    ("vast results postprocess-commands | less", "Page through the list"),
)
def postprocess_commands() -> None:
    """List the installed postprocessing commands and their parameters."""
    from robovast_cli.commands.results.postprocessing import print_commands

    print_commands()
