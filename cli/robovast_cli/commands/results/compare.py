"""`vast results compare`: a gate for CI."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.commands.results.options import ReportFormat, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Compare campaigns: what got worse, and whether chance explains it.")

_WHAT = "a campaign: its folder, or its name in the results folder."


@app.command()
def compare(
    ctx: typer.Context,
    base: Annotated[str, typer.Argument(metavar="BASE", help=f"Before: {_WHAT}")],
    new: Annotated[
        list[str], typer.Argument(metavar="NEW…", help=f"After: {_WHAT} May be several.")
    ],
    results_dir: ResultsDir = None,
    fail_on: Annotated[
        Literal["worse", "unclear"],
        typer.Option("--fail-on", help="The mildest result for which the exit code is not 0."),
    ] = "worse",
    margin: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Rise of the failure rate that does not matter: at least 0.",
        ),
    ] = 0.05,
    junit: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write a JUnit report.", show_default=False),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Also write a comment for a pull request.", show_default=False
        ),
    ] = None,
    output: ReportFormat = "text",
) -> None:
    """Compare campaigns with an earlier one: what got worse, and whether chance explains it.

    Configurations of equal parameters are compared: by McNemar's exact test where their runs have
    equal seeds, otherwise by Fisher's, with Holm's correction for their number. Several campaigns
    are compared with BASE one by one, and shown as a table.

    Exit code 0: not worse (or, without `--fail-on unclear`, unclear); 1: a configuration or all
    together got worse; 6: unclear, with `--fail-on unclear`; 2: nothing can be compared.
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
            f"--margin {margin:g}: a share of runs is at least 0 and below 1, such as 0.05."
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
                f"{before.name} and {after.name} cannot be compared: no configuration has the same "
                "parameters and runs with a verdict in both."
            )
        found.append((after.name, one))
    reports = ((junit, junit_of_all), (markdown, markdown_of_all))
    for path, report in reports:
        if path is not None:
            write_report(path, report(before.name, found))
    print_comparisons(before.name, found, output)
    raise typer.Exit(exit_code_of_all(found, fail_on))
