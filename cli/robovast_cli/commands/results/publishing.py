"""Publish campaigns, and report progress."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import typer

from robovast.analysis.publication.context import PublicationContext
from robovast.analysis.publication.plugin import GROUP
from robovast.analysis.publication.publish import PublishOptions, plan_publication, publish
from robovast.base.errors import ExitCode
from robovast.campaign.discovery import find_campaigns
from robovast_cli.commands.results.options import chosen_campaigns
from robovast_cli.commands.results.plugin_list import described_plugins
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import asked, say
from robovast_cli.workspace import shown

_GIVEN = ("results_dir", "config_dir", "context")
"""Parameters that no .vast file sets."""


@dataclass(frozen=True)
class Choice:
    """The options of the command."""

    campaigns: list[str] | None
    override: Path | None
    force: bool
    postprocess: bool
    upload: bool


def publish_campaigns(results: Path, choice: Choice) -> ExitCode:
    """Postprocess and publish the campaigns of a folder, or a campaign."""
    campaigns = [path.absolute() for path in chosen_campaigns(results, choice.campaigns)]
    options = PublishOptions(force=choice.force, skip_upload=not choice.upload)
    known = len(find_campaigns(campaigns[0].parent))
    batches = plan_publication(campaigns, choice.override, known, options)
    if choice.postprocess:
        code = _postprocess([item.path for batch in batches for item in batch.campaigns], choice)
        if code is not ExitCode.OK:
            typer.echo(
                "Nothing was published. `--skip-postprocessing` publishes without postprocessing.",
                err=True,
            )
            return code
    with Bars() as bars:
        publish(batches, options, _context(bars), say)
    return ExitCode.OK


def print_plugins() -> None:
    """Print all installed plugins, with an error for each that cannot be loaded."""
    typer.echo(described_plugins(GROUP, _GIVEN))
    typer.echo("\nTo use a plugin in a file, write `<path>.py:<name>`.")


def _postprocess(campaigns: list[Path], choice: Choice) -> ExitCode:
    from robovast.analysis.postprocessing.events import Options
    from robovast_cli.commands.results.postprocessing import run

    codes = [run(shown(path), Options(override=choice.override)) for path in campaigns]
    return next((code for code in codes if code is not ExitCode.OK), ExitCode.OK)


def _context(bars: Bars) -> PublicationContext:
    if not sys.stdin.isatty():
        return PublicationContext((), progress=bars)

    def confirm(path: Path) -> bool:
        bars.close()
        return asked(f"{shown(path)} exists with other contents. Replace it?", default=True)

    return PublicationContext((), confirm=confirm, progress=bars)
