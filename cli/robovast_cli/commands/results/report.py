"""`vast results report`: a report of a campaign in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast.base.atomic import write_report
from robovast.base.errors import InputError
from robovast.evaluation.campaign_report import make_report
from robovast_cli.commands.results.options import (
    CampaignName,
    ResultsDir,
    named_campaign,
    read_campaign,
)
from robovast_cli.lazy import examples
from robovast_cli.ui.campaign_report.html import to_html
from robovast_cli.ui.campaign_report.markdown import to_markdown
from robovast_cli.ui.output import echo
from robovast_cli.ui.progress_line import progress_line


@examples(
    ("vast results report results/hall-2026-03-05-132444", "Write report.html"),
    ("vast results report hall-2026-03-05-132444 -b hall-2026-03-04-132444", "Compare also"),
    ("vast results report hall-2026-03-05-132444 -o night.md", "Write Markdown"),
)
def report(
    ctx: typer.Context,
    campaign: CampaignName,
    results_dir: ResultsDir = None,
    baseline: Annotated[
        str | None,
        typer.Option(
            "-b",
            "--baseline",
            metavar="CAMPAIGN",
            help="Campaign to compare with: its folder, or its name in the results folder.",
        ),
    ] = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Report file that ends in .html or .md (default: report.html) (repeatable).",
        ),
    ] = None,
) -> None:
    """Write a report of a campaign as HTML or Markdown.

    The report contains verdicts, causes of failures, and a matrix of the two factors that separate
    failures best. For the worst configurations, it contains a map and the end of a log.

    The HTML file needs no server, contains no script and loads no other file. It is small enough
    for an email. Markdown fits into a pull request.
    """
    forms = {".html": to_html, ".htm": to_html, ".md": to_markdown}
    files = output or [Path("report.html")]
    for file in files:
        if file.suffix.lower() not in forms:
            raise InputError(
                f"{file}: a report is HTML or Markdown", hint="use a name that ends in .html or .md"
            )
    results = results_dir or ctx.obj.results
    with progress_line("Writing the report") as show:
        show("reading runs")
        index = read_campaign(named_campaign(results, campaign))
        base = None if baseline is None else read_campaign(named_campaign(results, baseline))
        show("searching for causes of failures")
        found = make_report(index, base)
        texts = {file: forms[file.suffix.lower()](found) for file in files}
    for file, text in texts.items():
        content = text.encode("utf-8", "backslashreplace")
        write_report(file, content)
        echo(f"{file}: {index.name} in {max(1, len(content) // 1000):,} kB")
