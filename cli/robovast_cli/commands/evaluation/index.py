"""`vast evaluation index`: the `campaign.db` of campaigns."""

from __future__ import annotations

from typing import Annotated

import typer

from robovast.analysis.tables.campaign_store import index_campaign
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.layout import Layout
from robovast.model.naming import CAMPAIGN_STORE
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.workspace import shown


@examples(
    ("vast evaluation index", "Index all campaigns of the project"),
    ("vast evaluation index -r results/hall-2026-03-04-152130 --force", "Recreate one index"),
)
def index(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Recreate a database that is newer than all runs.")
    ] = False,
) -> None:
    """Create the `campaign.db` of campaigns.

    The SQLite database contains parameters and verdicts of each configuration. `vast results
    postprocess` also creates it. The database of a search is not modified.
    """
    for campaign in find_campaigns(results_dir or ctx.obj.results):
        made = index_campaign(Layout(campaign.absolute()), force=force)
        echo(f"{shown(campaign)}: {CAMPAIGN_STORE}{'' if made else ' is up to date'}")
