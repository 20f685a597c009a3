"""`vast results coverage`: which combinations were run, and where the holes are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import CampaignName, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Say which pairs of values a campaign has run, which failed, and where holes are.")


@app.command()
def coverage(
    ctx: typer.Context,
    campaign: CampaignName,
    results_dir: ResultsDir = None,
    buckets: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1000,
            metavar="N",
            help="Equal parts into which values that were drawn are divided.",
            show_default=False,
        ),
    ] = None,
    worst: Annotated[
        int,
        typer.Option("--worst", min=0, metavar="N", help="Lines of each table; 0 means all."),
    ] = 10,
    holes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a .vast file that runs the pairs which were never run; it belongs beside "
            "the campaign's own.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Say which pairs of values of different variations a campaign has run, which of them failed,
    and which were never run.

    A pair's interval is Wilson's, of all runs in which the two values met.
    """
    from robovast.base.atomic import write_report
    from robovast.campaign.configurations import document_path, read_configurations
    from robovast.campaign.layout import Layout
    from robovast.evaluation.coverage import campaign_coverage
    from robovast.model.document import load_document
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.coverage import coverage_text, holes_text
    from robovast_cli.ui.output import say, say_data

    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    layout = Layout(folder)
    document = load_document(document_path(layout, read_configurations(layout)))
    found = campaign_coverage(document, read_campaign(folder).variants, buckets)
    say_data(coverage_text(found, worst))
    if holes is not None:
        text, count = holes_text(document, found)
        write_report(holes, text)
        say(f"{holes}: {count} configurations. Run them: vast -V {holes} exec local run")
