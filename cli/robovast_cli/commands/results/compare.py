"""`vast results compare`: a gate for CI."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.commands.results.options import ReportFormat, ResultsDir
from robovast_cli.lazy import examples, exit_codes

_CAMPAIGN = "folder of a campaign, or its name in the results folder"


@exit_codes(
    "0 not worse, or unclear · 1 a configuration or all together are worse · "
    "2 comparison impossible · 6 unclear, with --fail-on unclear"
)
@examples(
    ("vast results compare hall-2026-03-04-132444 hall-2026-03-05-132444", "Compare two"),
    ("vast results compare before after --fail-on unclear --junit gate.xml", "Set up a CI gate"),
)
def compare(
    ctx: typer.Context,
    base: Annotated[str, typer.Argument(metavar="BASE", help=f"Baseline: {_CAMPAIGN}.")],
    new: Annotated[
        list[str],
        typer.Argument(
            metavar="NEW…", help="Campaigns to compare, by folder or by name in the results folder."
        ),
    ],
    results_dir: ResultsDir = None,
    fail_on: Annotated[
        Literal["worse", "unclear"],
        typer.Option("--fail-on", help="Least severe result that gives a nonzero exit code."),
    ] = "worse",
    margin: Annotated[
        float,
        typer.Option(
            metavar="RATE",
            help="Tolerated rise of the failure rate. At least 0 and below 1.",
        ),
    ] = 0.05,
    junit: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Output file for a JUnit report.", show_default=False),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Output file for a comment of a pull request.", show_default=False
        ),
    ] = None,
    output: ReportFormat = "text",
) -> None:
    """Compare campaigns with a baseline.

    Configurations with equal parameters are compared one by one and all together. The test is
    McNemar's exact test if their runs have equal seeds, otherwise Fisher's, with Holm's correction
    for the number of configurations. Each campaign is compared with BASE on its own.
    """
    from robovast.base.atomic import write_report
    from robovast.base.errors import InputError
    from robovast.evaluation import compare as comparison
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.comparisons import (
        exit_code_of_all,
        junit_of_all,
        markdown_of_all,
        print_comparisons,
    )

    if not 0 <= margin < 1:
        raise InputError(
            f"--margin {margin:g}: the rate must be at least 0 and below 1",
            hint="use for example `--margin 0.05`",
        )
    results = results_dir or ctx.obj.results
    place = named_campaign(results, base)
    before = read_campaign(place)
    found = []
    for name in new:
        other = named_campaign(results, name)
        after = before if other == place else read_campaign(other)
        one = comparison.compare(before.variants, after.variants, margin)
        if not one.overall.a.runs or not one.overall.b.runs:
            raise InputError(
                f"cannot compare {before.name} and {after.name}: no configuration has equal "
                "parameters and runs with a verdict in both campaigns.",
                hint="compare campaigns of the same .vast file",
            )
        found.append((after.name, one))
    reports = ((junit, junit_of_all), (markdown, markdown_of_all))
    for path, report in reports:
        if path is not None:
            write_report(path, report(before.name, found))
    print_comparisons(before.name, found, output)
    raise typer.Exit(exit_code_of_all(found, fail_on))
