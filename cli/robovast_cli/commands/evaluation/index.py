"""`vast evaluation index`: the `campaign.db` of campaigns."""

from __future__ import annotations

from typing import Annotated

import typer

from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Make the campaigns' `campaign.db`.")


@app.command()
def index(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Also where it is newer than every run.")
    ] = False,
) -> None:
    """Make the `campaign.db` (SQLite) of campaigns: parameters and verdicts of each configuration.

    `vast results postprocess` makes it, too. What a search wrote itself is left as it is.
    """
    from robovast.analysis.tables.campaign_store import index_campaign
    from robovast.campaign.finding import find_campaigns
    from robovast.campaign.layout import Layout
    from robovast.model.naming import CAMPAIGN_STORE
    from robovast_cli.ui.output import say
    from robovast_cli.workspace import shown

    for campaign in find_campaigns(results_dir or ctx.obj.results):
        made = index_campaign(Layout(campaign.absolute()), force=force)
        say(f"{shown(campaign)}: {CAMPAIGN_STORE}{'' if made else ' is up to date'}")
