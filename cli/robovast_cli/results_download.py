"""`vast results download`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.cluster_options import Context, Namespace
from robovast_cli.lazy import new_app

app = new_app("Bring results home from the cluster's storage.")


@app.command()
def download(
    ctx: typer.Context,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Only this campaign: its name, or that of its results folder. May be repeated; "
            "all campaigns of the namespace when omitted.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="PATH",
            help="Folder for the campaigns' folders; the project's results folder when omitted.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Fetch everything, also what is here.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Bring results home: in parallel, verified, each run complete or not at all.

    What is here already is not fetched again, so that it can be repeated at any time: while the
    campaign runs, after an interruption, after more runs were added.
    """
    from robovast_cli.kubernetes import cluster_extra

    with cluster_extra():
        from robovast_cli.downloading import download_campaigns

    output = output or ctx.obj.results
    download_campaigns(context, namespace, campaign or [], output, force=force)
