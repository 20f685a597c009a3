"""Options that all commands for a cluster share."""

from typing import Annotated, Any

import typer


def _has_no_effect(given: list[str] | str | None) -> list[str] | str | None:
    if given:
        typer.echo(
            "note: cluster configurations and their options count for `vast exec cluster setup` "
            "alone: the cluster knows since then what it is; here they have no effect.",
            err=True,
        )
    return given


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

SetupOptions = Annotated[
    list[str] | None,
    typer.Option("-o", "--option", metavar="KEY=VALUE", hidden=True, callback=_has_no_effect),
]
"""What the existing tool's commands take: here the cluster itself knows it."""


def setup_config(letter: str) -> Any:
    """The existing tool's option that names a cluster configuration."""
    return typer.Option(
        f"-{letter}", "--cluster-config", metavar="NAME", hidden=True, callback=_has_no_effect
    )
