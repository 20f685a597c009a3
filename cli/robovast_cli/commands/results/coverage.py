"""`vast results coverage`: combinations that were run, and coverage gaps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import CampaignName, ResultsDir
from robovast_cli.lazy import examples


@examples(
    ("vast results coverage results/hall-2026-03-04-152130", "Show failures and gaps"),
    ("vast results coverage hall-2026-03-04-152130 --holes gaps.vast", "Write the missing runs"),
)
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
            help="Number of equal intervals that group random values.",
            show_default=False,
        ),
    ] = None,
    worst: Annotated[
        int,
        typer.Option(
            "--worst", min=0, metavar="N", help="Maximum length of each table. 0 lists everything."
        ),
    ] = 10,
    holes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Output .vast file that runs the missing pairs. Write it into the folder of the "
            "campaign's .vast file.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show failed pairs of values, and coverage gaps.

    A pair consists of two values of different variations. Its failure rate counts all runs with
    both values, and has Wilson's interval. A coverage gap is a pair that was never run.
    """
    from robovast.base.atomic import write_report
    from robovast.campaign.configurations import document_path, read_configurations
    from robovast.campaign.layout import Layout
    from robovast.evaluation.coverage import campaign_coverage
    from robovast.model.document import load_document
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.coverage import coverage_text, holes_text
    from robovast_cli.ui.output import say, say_data
    from robovast_cli.ui.table import counted

    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    layout = Layout(folder)
    document = load_document(document_path(layout, read_configurations(layout)))
    found = campaign_coverage(document, read_campaign(folder).variants, buckets)
    say_data(coverage_text(found, worst))
    if holes is not None:
        text, count = holes_text(document, found)
        write_report(holes, text)
        say(f"{holes}: {counted(count, 'configuration')}. To run: vast -V {holes} exec local run")
