"""`vast results junit`: all runs in one report for CI systems."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast.base.atomic import write_report
from robovast.base.errors import InputError
from robovast.campaign.junit import merged_suites, report_text
from robovast.campaign.layout import Layout
from robovast_cli.commands.results.options import CampaignName, ResultsDir, named_campaign
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import counted


@examples(
    ("vast results junit results/hall-2026-03-04-152130 runs.xml", "Merge one campaign"),
    ("vast results junit hall-2026-03-04-152130 runs.xml -r results", "Set the results folder"),
)
def junit(
    ctx: typer.Context,
    campaign: CampaignName,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Report file. An existing file is replaced.")
    ],
    results_dir: ResultsDir = None,
) -> None:
    """Merge the test results of all runs into one JUnit report.

    Each configuration is a suite, and each test of each run is a case. If a run has no report, or
    its report contradicts its verdict, the run is one case with the verdict. An interrupted run is
    a skipped case.
    """
    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    suites = merged_suites(Layout(folder))
    if not suites:
        raise InputError(
            f"{folder.name} has no stored runs, so there is nothing to report.",
            hint="wait until a run has finished",
        )
    write_report(file, report_text(folder.name, suites))
    cases = [case for suite in suites for case in suite.cases]
    bad = sum(case.outcome in {"failure", "error"} for case in cases)
    found = f"{counted(len(cases), 'case')} of {counted(len(suites), 'configuration')}"
    echo(f"{file}: {found}, {bad} failed or errored")
