"""`vast results publish` and `vast results publish-commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import Campaigns, ResultsDir
from robovast_cli.lazy import examples, exit_codes


@exit_codes("2 invalid file or plugin, nothing was done · 5 a plugin failed")
@examples(
    ("vast results publish", "Publish all campaigns"),
    ("vast results publish -i hall-2026-03-04-152130 --skip-upload", "Pack one campaign"),
)
def publish(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    campaign: Campaigns = None,
    override: Annotated[
        Path | None,
        typer.Option(
            "--override",
            metavar="VAST_FILE",
            help="File that replaces the .vast file of each campaign.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace existing archives without confirmation.")
    ] = False,
    skip_postprocessing: Annotated[
        bool,
        typer.Option("--skip-postprocessing", help="Publish without postprocessing."),
    ] = False,
    skip_upload: Annotated[
        bool, typer.Option("--skip-upload", help="Pack only. Skip plugins that upload.")
    ] = False,
) -> int:
    """Pack and publish results as configured in the .vast file.

    The configuration is in `results_processing.publication`. First, the campaigns are
    postprocessed. Then packing plugins run, and uploading plugins last. The command stops at the
    first plugin that fails.
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


@examples(
    ("vast results publish-commands", "List the plugins"),
    ("vast results publish-commands | less", "Page through the list"),
)
def publish_commands() -> None:
    """List the installed publication plugins and their parameters."""
    from robovast_cli.commands.results.publishing import print_plugins

    print_plugins()
