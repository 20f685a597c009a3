"""`vast results list-share` and `vast results remove-from-share`."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from robovast.base.errors import InputError
from robovast.base.sizes import fmt_size
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app

list_app = new_app("List the campaigns on the share.")
remove_app = new_app("Remove campaigns from the share.")


@list_app.command()
def list_share(
    ctx: typer.Context,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME|GLOB",
            help="Only this campaign. May be repeated; all when omitted.",
            show_default=False,
        ),
    ] = None,
    results_dir: ResultsDir = None,
) -> None:
    """List the campaigns on the share, and which of them exist here.

    The share is described by ROBOVAST_SHARE_TYPE and the variables of its kind, in the
    environment or a `.env` file in this folder or above; docs/how-to/publish.md has them all.
    """
    from robovast.storage.shares.campaigns import open_share
    from robovast_cli.ui.table import format_table

    results = results_dir or ctx.obj.results
    with open_share() as share:
        campaigns = share.chosen(campaign or [])
    if campaign and not campaigns:
        raise InputError("nothing on the share is called so; without `-i` all is listed.")
    rows = [
        [item.name, fmt_size(item.size), "yes" if os.path.isdir(results / item.name) else "no"]
        for item in campaigns
    ]
    typer.echo(format_table(["CAMPAIGN", "SIZE", "HERE"], rows), nl=False)


@remove_app.command()
def remove_from_share(
    campaign: Annotated[
        list[str],
        typer.Option(
            "-i", "--campaign", metavar="NAME|GLOB", help="The campaign. May be repeated."
        ),
    ],
    yes: Annotated[bool, typer.Option("-y", "--yes", help="Do not ask.")] = False,
) -> None:
    """Remove campaigns from the share; local results are kept."""
    from robovast.storage.shares.campaigns import open_share
    from robovast_cli.ui.output import say

    with open_share() as share:
        chosen = share.chosen(campaign)
        for item in chosen:
            say(f"{item.name}: {fmt_size(item.size)}")
        if chosen and not yes:
            typer.confirm("Remove from the share?", abort=True)
        for item in chosen:
            share.remove(item)
            say(f"Removed {item.name} from the share.")
