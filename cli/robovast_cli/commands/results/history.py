"""`vast results history`: one configuration in all campaigns."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import ReportFormat, ResultsDir
from robovast_cli.lazy import examples


@examples(
    ("vast results history hall-3", "Use the name in the latest campaign"),
    ("vast results history hall-3 -i hall-2026-03-04-152130 -o json", "Print JSON"),
)
def history(
    ctx: typer.Context,
    configuration: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG",
            help="Folder of a configuration, or its name in the latest campaign that contains it.",
        ),
    ],
    campaign: Annotated[
        str | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Campaign in which the configuration has this name (default: the latest).",
            show_default=False,
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: ReportFormat = "text",
) -> None:
    """Show the failure rate of a configuration in each campaign.

    Lists the oldest campaign first, and shows which inputs changed in each campaign. Inputs are the
    image, environment, RoboVAST version, seed, parameters, scenario, .vast file, and other files of
    the campaign and the configuration.

    A configuration is recognized by its parameters, even under another name. Without parameters,
    it is recognized by its name.
    """
    from robovast.evaluation.configuration_index import default_index
    from robovast.evaluation.history import history, latest_with
    from robovast.model.naming import holds_campaign
    from robovast_cli.commands.results.options import named_campaign
    from robovast_cli.ui.history import print_history
    from robovast_cli.ui.working import working

    results, name = (results_dir or ctx.obj.results).resolve(), configuration.rstrip("/")
    folder = Path(os.path.realpath(name))
    if campaign is None and holds_campaign(folder.parent):
        results, campaign, name = folder.parent.parent, folder.parent.name, folder.name
    elif campaign is not None:
        named = named_campaign(results, campaign)
        results, campaign = named.parent, named.name
    elif holds_campaign(results):
        results, campaign = results.parent, results.name
    with working("Searching campaigns") as tell:
        found = history(
            results,
            campaign or latest_with(results, name),
            name,
            default_index(),
            progress=lambda other, place, total: tell(f"{other}, {place} of {total} campaigns"),
        )
    print_history(name, found, output)
