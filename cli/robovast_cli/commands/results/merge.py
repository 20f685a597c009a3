"""`vast results merge-campaigns`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import Campaigns, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Merge campaigns: runs of equal configurations come together.")


@app.command()
def merge_campaigns(
    ctx: typer.Context,
    target: Annotated[
        Path, typer.Argument(metavar="DIR", help="New folder for the merged campaign.")
    ],
    results_dir: ResultsDir = None,
    campaign: Campaigns = None,
) -> None:
    """Merge campaigns: runs of equal configurations are collected and renumbered.

    The campaigns stay as they are. Tables, metadata and provenance are not taken over:
    `vast results postprocess -r DIR` makes them of all runs together.
    """
    from robovast_cli.commands.results.merging import merge
    from robovast_cli.commands.results.options import chosen_campaigns

    campaigns = chosen_campaigns(results_dir or ctx.obj.results, campaign)
    sources = [path for path in campaigns if path.absolute() != target.absolute()]
    merge(sources, target, "campaign")
