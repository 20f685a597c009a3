"""`vast results publish` and `vast results publish-commands`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from robovast.analysis.postprocessing.events import Options
from robovast.analysis.publication import publish as publication
from robovast.analysis.publication.context import PublicationContext
from robovast.analysis.publication.plugin import GROUP
from robovast.analysis.publication.publish import PublishOptions
from robovast.base.errors import ExitCode
from robovast.campaign.discovery import find_campaigns
from robovast_cli.commands.results.options import Campaigns, ResultsDir, chosen_campaigns
from robovast_cli.commands.results.plugin_list import describe_plugins
from robovast_cli.commands.results.postprocess import postprocess_campaigns
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import ask, echo
from robovast_cli.workspace import shown

_GIVEN = ("results_dir", "config_dir", "context")
"""Parameters that no .vast file sets."""


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
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace existing archives without confirmation.")
    ] = False,
    skip_postprocessing: Annotated[
        bool, typer.Option("--skip-postprocessing", help="Publish without postprocessing.")
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
    campaigns = [
        path.absolute() for path in chosen_campaigns(results_dir or ctx.obj.results, campaign)
    ]
    options = PublishOptions(force=force, skip_upload=skip_upload)
    known = len(find_campaigns(campaigns[0].parent))
    batches = publication.plan_publication(campaigns, override, known, options)
    if not skip_postprocessing:
        paths = [shown(item.path) for batch in batches for item in batch.campaigns]
        codes = [postprocess_campaigns(path, Options(override=override)) for path in paths]
        if failed := [code for code in codes if code is not ExitCode.OK]:
            typer.echo(
                "Nothing was published. `--skip-postprocessing` publishes without postprocessing.",
                err=True,
            )
            return failed[0]
    with Bars() as bars:
        publication.publish(batches, options, _context(bars), echo)
    return ExitCode.OK


@examples(
    ("vast results publish-commands", "List the plugins"),
    ("vast results publish-commands | less", "Page through the list"),
)
def publish_commands() -> None:
    """List the installed publication plugins and their parameters."""
    typer.echo(describe_plugins(GROUP, _GIVEN))
    typer.echo("\nTo use a plugin in a file, write `<path>.py:<name>`.")


def _context(bars: Bars) -> PublicationContext:
    if not sys.stdin.isatty():
        return PublicationContext((), progress=bars)

    def confirm(path: Path) -> bool:
        bars.close()
        return ask(f"{shown(path)} exists with other contents. Replace it?", default=True)

    return PublicationContext((), confirm=confirm, progress=bars)
