"""`vast results list-share` and `vast results remove-from-share`."""

from __future__ import annotations

from typing import Annotated

import typer

from robovast_cli.lazy import new_app
from robovast_cli.results_options import ResultsDir

list_app = new_app("List the campaigns on the share.")
remove_app = new_app("Remove campaigns from the share.")


@list_app.command()
def list_share(ctx: typer.Context, results_dir: ResultsDir = None) -> None:
    """List the campaigns on the share, and which of them are here.

    The share is described by ROBOVAST_SHARE_TYPE and the variables of its kind, in the
    environment or a `.env` file in this folder or above; docs/publication.md has them all.
    """
    from robovast.common.progress import fmt_size
    from robovast.results.share import open_share
    from robovast_cli.listing import format_table

    results = results_dir or ctx.obj.results
    with open_share() as share:
        campaigns = share.campaigns()
    rows = [
        [item.name, fmt_size(item.size), "yes" if (results / item.name).is_dir() else "no"]
        for item in campaigns
    ]
    typer.echo(format_table(["CAMPAIGN", "SIZE", "HERE"], rows), nl=False)


@remove_app.command()
def remove_from_share(
    campaign: Annotated[
        list[str],
        typer.Option("-i", "--campaign", metavar="NAME", help="The campaign. May be repeated."),
    ],
) -> None:
    """Remove campaigns from the share; what is here stays."""
    from robovast.results.share import open_share
    from robovast_cli.output import say

    with open_share() as share:
        for item in share.chosen(campaign):
            share.remove(item)
            say(f"Removed {item.name} from the share.")
