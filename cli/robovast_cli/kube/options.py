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


def context_option(repeated: str = "") -> Any:
    """The option `--context`.

    Args:
        repeated: what it means when it is given more than once, as a sentence.
    """
    told = "Context of the kubeconfig; the current one when omitted."
    return typer.Option(
        "-x",
        "--context",
        metavar="NAME",
        help=f"{told} {repeated}".rstrip(),
        show_default=False,
    )


Context = Annotated[str | None, context_option()]
Contexts = Annotated[
    list[str] | None,
    context_option(
        "If it is repeated, the campaign's configurations are divided among these clusters."
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
