"""`vast results summary`: how a campaign went."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Annotated

import typer

from robovast_cli.commands.results.buckets import Bucket, Context, Namespace
from robovast_cli.commands.results.options import ReportFormat, ResultsDir
from robovast_cli.lazy import new_app

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from robovast.evaluation.summaries import CampaignSummary, VariantRuns

app = new_app("Say how a campaign went: which configurations fail how often, and how sure that is.")


@app.command()
def summary(
    ctx: typer.Context,
    campaign: Annotated[
        str | None,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Folder of a campaign, or its name in the results folder; the only one there when "
            "omitted.",
            show_default=False,
        ),
    ] = None,
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
            "--worst", min=0, metavar="N", help="Configurations in the table; 0 means all."
        ),
    ] = 30,
    output: ReportFormat = "text",
    bucket: Bucket = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Say how a campaign went: configurations, the worst first, each failure rate with its
    interval, what is undecided, why runs failed, and which factors make them fail.

    A configuration is sound or broken when the 95 % interval of its failure rate lies below or
    above the limit, and undecided otherwise. Runs that failed or errored are bad; interrupted ones
    do not count. JSON holds all configurations, causes and parameters. With --bucket only the
    tables of the campaign are read, when all runs have ended.
    """
    from robovast.base.errors import InputError
    from robovast.campaign.failure_groups import failure_groups
    from robovast.evaluation.effects import effects
    from robovast.evaluation.rates import campaign_rates
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.summary import Findings, print_summary
    from robovast_cli.workspace import shown

    if not 0 < limit < 1:
        raise InputError(f"--limit {limit:g}: a share of runs is above 0 and below 1, such as 0.1.")
    if campaign is not None and bucket is not None:
        raise InputError("name one campaign: CAMPAIGN is here, `--bucket NAME` is in a bucket.")
    if bucket is not None:
        folder, (found, variants) = None, _in_bucket(bucket, context, namespace)
    else:
        results = results_dir or ctx.obj.results
        index = read_campaign(named_campaign(results, campaign or str(results)))
        folder, found, variants = shown(index.results), index.summary(), index.variants
    findings = Findings(
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
    """Arguments that let a search go on; empty for any other campaign."""
    if results is None or not summary.is_search:
        return ()
    from robovast.base.errors import InputError
    from robovast.evaluation.searches import go_on_words

    with suppress(InputError):  # what its runs say is told all the same
        return go_on_words(results, summary)
    return ()


def _in_bucket(
    name: str, context: str | None, namespace: str | None
) -> tuple[CampaignSummary, list[VariantRuns]]:
    """A campaign in a bucket, of which only the tables are read."""
    from robovast.campaign.layout import EXECUTION_RECORD, SEARCH
    from robovast.evaluation.campaign_index import summarized
    from robovast.evaluation.tabled_campaign import read_variants
    from robovast.evaluation.untrusted import read_yaml
    from robovast_cli.commands.results.buckets import opened

    with opened([name], context, namespace) as (place,):
        variants = read_variants(place.tables())
        execution = read_yaml(place.bring(EXECUTION_RECORD), EXECUTION_RECORD)
        searches = place.has(SEARCH)
    return summarized(place.campaign, variants, execution, is_search=searches), variants
