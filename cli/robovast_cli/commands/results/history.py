"""`vast results history`: one configuration over campaigns."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import ReportFormat, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Say how often a configuration failed in each campaign, and what changed between.")


@app.command()
def history(
    ctx: typer.Context,
    configuration: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG",
            help="A configuration: its name in the latest campaign that has it, or its folder.",
        ),
    ],
    campaign: Annotated[
        str | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="The campaign in which it has this name.",
            show_default=False,
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: ReportFormat = "text",
) -> None:
    """List how often a configuration failed in each campaign of the results folder, the oldest
    first, and which inputs changed: image, environment, RoboVAST version, seed, parameters,
    scenario, .vast file, and all other files of the campaign and the configuration.

    A configuration is recognized by its parameters, whatever its name; by its name if it has none.
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
    with working("Looking for it") as tell:
        found = history(
            results,
            campaign or latest_with(results, name),
            name,
            default_index(),
            progress=lambda other, place, total: tell(f"{other}, {place} of {total} campaigns"),
        )
    print_history(name, found, output)
