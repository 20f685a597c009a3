"""`vast results list-share` and `vast results remove-from-share`."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from robovast.base.errors import InputError
from robovast.base.sizes import fmt_size
from robovast.storage.shares.campaigns import open_share
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table


@examples(
    ("vast results list-share", "List all campaigns"),
    ("vast results list-share -i 'hall-*'", "List a selection"),
)
def list_share(
    ctx: typer.Context,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME|GLOB",
            help="Campaign on the file share (default: all) (repeatable).",
        ),
    ] = None,
    results_dir: ResultsDir = None,
) -> None:
    """List the campaigns on the file share.

    The column LOCAL shows whether the campaign exists in the results folder. ROBOVAST_SHARE_TYPE
    (nextcloud, webdav, sftp or gcs) and the variables of its type describe the file share. Set them
    in the environment or in a `.env` file in this folder or above. The documentation lists the
    variables on the page "Publish, merge, import and share results".
    """
    results = results_dir or ctx.obj.results
    with open_share() as share:
        campaigns = share.chosen(campaign or [])
    if campaign and not campaigns:
        raise InputError(
            "no campaign on the file share has this name",
            hint="run `vast results list-share` to list all",
        )
    rows = [
        [item.name, fmt_size(item.size), "yes" if os.path.isdir(results / item.name) else "no"]
        for item in campaigns
    ]
    typer.echo(format_table(["CAMPAIGN", "SIZE", "LOCAL"], rows), nl=False)


@examples(
    ("vast results remove-from-share -i hall-2026-03-04-152130", "Delete after confirmation"),
    ("vast results remove-from-share -i 'hall-2026-02-*' -y", "Delete a selection"),
)
def remove_from_share(
    campaign: Annotated[
        list[str],
        typer.Option(
            "-i", "--campaign", metavar="NAME|GLOB", help="Campaign to delete (repeatable)."
        ),
    ],
    yes: Annotated[bool, typer.Option("-y", "--yes", help="Delete without confirmation.")] = False,
) -> None:
    """Delete campaigns from the file share.

    Local results are kept.
    """
    with open_share() as share:
        chosen = share.chosen(campaign)
        for item in chosen:
            echo(f"{item.name}: {fmt_size(item.size)}")
        if chosen and not yes:
            typer.confirm("Delete from the file share?", abort=True)
        for item in chosen:
            share.remove(item)
            echo(f"Deleted {item.name} from the file share.")
