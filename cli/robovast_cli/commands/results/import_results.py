"""`vast import-results`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import Target
from robovast_cli.lazy import new_app

app = new_app("Take over a campaign that comes as an archive.")


@app.command()
def import_results(
    ctx: typer.Context,
    archive: Annotated[
        Path, typer.Argument(metavar="ARCHIVE", help="A campaign's .tar.gz or .zip file.")
    ],
    output: Target = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace a campaign of the same name.")
    ] = False,
) -> None:
    """Take over a campaign that comes as an archive.

    It appears complete or not at all, and nothing is written outside of its folder.
    """
    from robovast.campaign.executables import warn_of_executables
    from robovast.campaign.importing import import_archive
    from robovast_cli.ui.output import say
    from robovast_cli.ui.working import working
    from robovast_cli.workspace import shown

    with working(f"Unpacking {archive}"):
        campaign = import_archive(archive, output or ctx.obj.results, force=force)
    say(f"Imported {shown(campaign)}.")
    if warning := warn_of_executables(campaign):
        say(warning)
