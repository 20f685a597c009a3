"""`vast results summary`: how a campaign went."""

from __future__ import annotations

from typing import Annotated

import typer

from robovast_cli.commands.results.options import CampaignName, ReportFormat, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Say how a campaign went: which configurations fail how often, and how sure that is.")


@app.command()
def summary(
    ctx: typer.Context,
    campaign: CampaignName,
    results_dir: ResultsDir = None,
    limit: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Share of bad runs between sound and broken: above 0 and below 1.",
        ),
    ] = 0.1,
    worst: Annotated[
        int,
        typer.Option(
            "-n", "--worst", min=0, metavar="N", help="Configurations in the table; 0 means all."
        ),
    ] = 30,
    output: ReportFormat = "text",
) -> None:
    """Say how a campaign went: configurations, the worst first, each failure rate with its
    interval, what is undecided, why runs failed, and which factors make them fail.

    A configuration is sound or broken when the 95 % interval of its failure rate lies below or
    above the limit, and undecided otherwise. Runs that failed or errored are bad; interrupted ones
    do not count. JSON holds all configurations, causes and parameters.
    """
    from robovast.base.errors import InputError
    from robovast.campaign.failure_groups import failure_groups
    from robovast.evaluation.effects import effects
    from robovast.evaluation.rates import campaign_rates
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.summary import Findings, print_summary

    if not 0 < limit < 1:
        raise InputError(f"--limit {limit:g}: a share of runs is above 0 and below 1, such as 0.1.")
    index = read_campaign(named_campaign(results_dir or ctx.obj.results, campaign))
    findings = Findings(
        campaign_rates(index.summary(), index.variants, limit),
        failure_groups(
            (f"{variant.name}/{run.number}", run.verdict, run.reason)
            for variant in index.variants
            for run in variant.runs
        ),
        effects(index.variants),
    )
    print_summary(findings, output, worst)
