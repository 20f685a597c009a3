"""`vast results publish` and `vast results publish-commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import Campaigns, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Pack and publish results as configured in the .vast file.")
commands_app = new_app("List the installed publication plugins and their parameters.")


@app.command()
def publish(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    campaign: Campaigns = None,
    override: Annotated[
        Path | None,
        typer.Option(
            "--override",
            metavar="VAST_FILE",
            help="Use this .vast file in place of each campaign's own.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace archives that exist without asking.")
    ] = False,
    skip_postprocessing: Annotated[
        bool,
        typer.Option("--skip-postprocessing", help="Publish the results as they are."),
    ] = False,
    skip_upload: Annotated[
        bool, typer.Option("--skip-upload", help="Pack only: leave out plugins that upload.")
    ] = False,
) -> int:
    """Pack and publish results as configured in `results_processing.publication`.

    The campaigns are postprocessed before. Plugins that pack come before those that upload, and
    the first that fails ends it. Exit code 2: the file or a plugin's name is wrong, and nothing
    was done; 5: a plugin failed.
    """
    from robovast_cli.commands.results.publishing import Choice, publish_campaigns

    return publish_campaigns(
        results_dir or ctx.obj.results,
        Choice(
            campaigns=campaign,
            override=override,
            force=force,
            postprocess=not skip_postprocessing,
            upload=not skip_upload,
        ),
    )


@commands_app.command()
def publish_commands() -> None:
    """List the installed publication plugins and their parameters."""
    from robovast_cli.commands.results.publishing import print_plugins

    print_plugins()
