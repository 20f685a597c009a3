"""`vast import-results`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast.campaign.executables import warn_of_executables
from robovast.campaign.importing import import_archive
from robovast_cli.commands.results.options import Target
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.workspace import shown


@examples(
    ("vast import-results hall-2026-03-04-152130.tar.gz", "Import into the results folder"),
    ("vast import-results hall-2026-03-04-152130.zip -o archive", "Import into another folder"),
)
def import_results(
    ctx: typer.Context,
    archive: Annotated[
        Path, typer.Argument(metavar="ARCHIVE", help="Archive of a campaign (.tar.gz or .zip).")
    ],
    output: Target = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace a campaign of the same name.")
    ] = False,
) -> None:
    """Import a campaign from an archive.

    The campaign is imported completely or not at all. No file is written outside its folder.
    """
    with progress_line(f"Unpacking {archive}"):
        campaign = import_archive(archive, output or ctx.obj.results, force=force)
    echo(f"Imported {shown(campaign)}.")
    if warning := warn_of_executables(campaign):
        echo(warning)
