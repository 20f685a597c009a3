"""`vast results summary`: failure rates, causes and factors of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from robovast.base.errors import InputError
from robovast.campaign.failure_groups import failure_groups
from robovast.campaign.layout import EXECUTION_RECORD, SEARCH
from robovast.evaluation.campaign_index import summarized
from robovast.evaluation.effects import effects
from robovast.evaluation.rates import campaign_rates
from robovast.evaluation.searches import go_on_words
from robovast.evaluation.summaries import CampaignSummary, VariantRuns
from robovast.evaluation.tabled_campaign import read_variants
from robovast.evaluation.untrusted_data import read_yaml
from robovast_cli.commands.results.buckets import Bucket, Context, Namespace, open_campaigns
from robovast_cli.commands.results.options import (
    ReportFormat,
    ResultsDir,
    named_campaign,
    read_campaign,
)
from robovast_cli.lazy import examples
from robovast_cli.ui.summary import SummaryFindings, print_summary
from robovast_cli.workspace import shown


@examples(
    ("vast results summary results/hall-2026-03-04-152130", "Show one campaign"),
    ("vast results summary --worst 0 --limit 0.2", "List all configurations"),
    ("vast results summary --bucket hall-2026-03-04-152130", "Read the object storage"),
)
def summary(
    ctx: typer.Context,
    campaign: Annotated[
        str | None,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Folder of a campaign, or its name in the results folder (default: its only "
            "campaign).",
        ),
    ] = None,
    results_dir: ResultsDir = None,
    limit: Annotated[
        float,
        typer.Option(
            metavar="RATE",
            help="Threshold between passing and failing configurations. Above 0 and below 1.",
        ),
    ] = 0.1,
    worst: Annotated[
        int,
        typer.Option(
            "--worst", min=0, metavar="N", help="Maximum length of each table. 0 lists everything."
        ),
    ] = 30,
    output: ReportFormat = "text",
    bucket: Bucket = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Show failure rates, their causes and factors.

    A configuration is passing if the 95 % interval of its failure rate is below the threshold. It
    is failing if the interval is above the threshold, and inconclusive if the interval contains the
    threshold. Failed and errored runs are unsuccessful. Interrupted runs do not count.

    The worst configurations are listed first. JSON contains all configurations, causes and
    parameters. --bucket reads only the tables of the campaign, after all runs have finished.
    """
    if not 0 < limit < 1:
        raise InputError(
            f"--limit {limit:g}: the rate must be above 0 and below 1",
            hint="use for example `--limit 0.1`",
        )
    if campaign is not None and bucket is not None:
        raise InputError(
            "CAMPAIGN (a local folder) and `--bucket NAME` (object storage) exclude each other",
            hint="use one of them",
        )
    if bucket is not None:
        folder, (found, variants) = None, _in_bucket(bucket, context, namespace)
    else:
        results = results_dir or ctx.obj.results
        index = read_campaign(named_campaign(results, campaign))
        folder, found, variants = shown(index.results), index.summary(), index.variants
    findings = SummaryFindings(
        folder,
        campaign_rates(found, variants, limit),
        failure_groups(
            (f"{variant.name}/{run.number}", run.verdict, run.reason)
            for variant in variants
            for run in variant.runs
        ),
        effects(variants),
        _batches(folder, found),
    )
    print_summary(findings, output, worst)


def _batches(results: Path | None, summary: CampaignSummary) -> Sequence[str]:
    """Return the arguments that resume a search; empty for any other campaign."""
    if results is None or not summary.is_search:
        return ()
    with suppress(InputError):  # its rates are shown anyway
        return go_on_words(results, summary)
    return ()


def _in_bucket(
    name: str, context: str | None, namespace: str | None
) -> tuple[CampaignSummary, list[VariantRuns]]:
    """Read only the tables of a campaign in a bucket."""
    with open_campaigns([name], context, namespace) as (place,):
        variants = read_variants(place.tables())
        execution = read_yaml(place.fetch(EXECUTION_RECORD), EXECUTION_RECORD)
        searches = place.has(SEARCH)
    return summarized(place.campaign, variants, execution, is_search=searches), variants
