"""`vast results merge-campaigns`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast.campaign.merge import merge_campaigns as merge
from robovast_cli.commands.results.options import Campaigns, ResultsDir, chosen_campaigns
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown


@examples(
    ("vast results merge-campaigns merged", "Merge all campaigns"),
    ("vast results merge-campaigns merged -i hall-part-1 -i hall-part-2", "Merge two campaigns"),
)
def merge_campaigns(
    ctx: typer.Context,
    target: Annotated[
        Path, typer.Argument(metavar="DIR", help="New folder for the merged campaign.")
    ],
    results_dir: ResultsDir = None,
    campaign: Campaigns = None,
) -> None:
    """Merge campaigns into a new campaign.

    Runs of equal configurations are collected and renumbered. The campaigns are not modified.
    Tables, metadata and provenance are not copied. Create them with
    `vast results postprocess -r DIR`.
    """
    campaigns = chosen_campaigns(results_dir or ctx.obj.results, campaign)
    sources = [path for path in campaigns if path.absolute() != target.absolute()]
    with progress_line(f"Merging {counted(len(sources), 'campaign')}"):
        result = merge(sources, target)
    for path in result.unidentified:
        echo(f"{path}: not merged with other configurations, because it has no config_identifier.")
    for path in result.left_out:
        echo(f"{path}: skipped, because it has no `run.json` of a finished run.")
    echo(
        f"Merged {counted(len(sources), 'campaign')} into {shown(target)}: "
        f"{counted(result.configurations, 'configuration')}, {counted(result.runs, 'run')}."
    )
