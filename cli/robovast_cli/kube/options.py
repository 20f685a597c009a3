"""Options that all commands for a cluster share."""

from typing import Annotated, Any

import typer


def _has_no_effect(given: list[str] | str | None) -> list[str] | str | None:
    if given:
        typer.echo(
            "note: cluster configurations and their options have an effect only in `vast exec "
            "cluster setup`, which stores them in the cluster.",
            err=True,
        )
    return given


Context = Annotated[
    str | None,
    typer.Option(
        "-x",
        "--context",
        metavar="NAME",
        help="Context of the kubeconfig (default: the current context).",
    ),
]
Namespace = Annotated[
    str | None,
    typer.Option(
        "-n",
        "--namespace",
        metavar="NAME",
        help="Namespace (default: from the context, else `default`).",
    ),
]
CampaignName = Annotated[
    str | None,
    typer.Option(
        "-i",
        "--campaign",
        metavar="NAME",
        help="Campaign, by its name or the name of its results folder.",
    ),
]

SetupOptions = Annotated[
    list[str] | None,
    typer.Option("-o", "--option", metavar="KEY=VALUE", hidden=True, callback=_has_no_effect),
]
"""Options of the original RoboVAST, without effect because the cluster stores them."""


def setup_config(letter: str) -> Any:
    """Return the option of the original RoboVAST that names a cluster configuration."""
    return typer.Option(
        f"-{letter}", "--cluster-config", metavar="NAME", hidden=True, callback=_has_no_effect
    )
