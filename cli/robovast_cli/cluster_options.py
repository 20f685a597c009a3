"""Options that all commands for a cluster share."""

from typing import Annotated

import typer

Context = Annotated[
    str | None,
    typer.Option(
        "-x",
        "--context",
        metavar="NAME",
        help="Context of the kubeconfig; the current one when omitted.",
        show_default=False,
    ),
]
Namespace = Annotated[
    str | None,
    typer.Option(
        "-n",
        "--namespace",
        metavar="NAME",
        help="Namespace; the context's, else `default`, when omitted.",
        show_default=False,
    ),
]
CampaignName = Annotated[
    str | None,
    typer.Option(
        "-i",
        "--campaign",
        metavar="NAME",
        help="The campaign: its name, or that of its results folder.",
        show_default=False,
    ),
]
