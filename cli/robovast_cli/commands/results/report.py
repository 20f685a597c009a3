"""`vast results report`: a file about a campaign that can be sent."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.results.options import CampaignName, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Write a report of a campaign to send: one HTML file, or Markdown.")


@app.command()
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
            help="Also say what differs from this campaign: its folder, or its name in the results "
            "folder.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="The report: .html, or .md for a pull request; report.html when omitted. May be "
            "repeated.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write a report of a campaign to send: verdicts, causes, the matrix of the two factors that
    separate failures best, and of the worst configurations the map and how a run ended.

    The HTML file needs no server, runs no script and loads nothing from elsewhere; it is small
    enough for a mail, whatever the number of runs.
    """
    from robovast.base.atomic import write_report
    from robovast.base.errors import InputError
    from robovast.evaluation.campaign_report import make_report
    from robovast_cli.commands.results.options import named_campaign, read_campaign
    from robovast_cli.ui.campaign_report.html import to_html
    from robovast_cli.ui.campaign_report.markdown import to_markdown
    from robovast_cli.ui.output import say
    from robovast_cli.ui.working import working

    forms = {".html": to_html, ".htm": to_html, ".md": to_markdown}
    files = output or [Path("report.html")]
    for file in files:
        if file.suffix.lower() not in forms:
            raise InputError(f"{file}: a report is HTML or Markdown; end its name in .html or .md.")
    results = results_dir or ctx.obj.results
    with working("Making the report") as tell:
        tell("reading runs")
        index = read_campaign(named_campaign(results, campaign))
        base = None if baseline is None else read_campaign(named_campaign(results, baseline))
        tell("looking for what makes runs fail")
        found = make_report(index, base)
        texts = {file: forms[file.suffix.lower()](found) for file in files}
    for file, text in texts.items():
        content = text.encode("utf-8", "backslashreplace")
        write_report(file, content)
        say(f"{file}: {index.name} in {max(1, len(content) // 1000):,} kB")
