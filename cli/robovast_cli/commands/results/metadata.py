"""`vast results metadata`: metadata.yaml and the provenance graph of campaigns."""

import logging
from typing import Annotated

import typer

from robovast.analysis.provenance import describe
from robovast.analysis.provenance.drawing import write_drawing
from robovast.base.errors import ExitCode, RobovastError
from robovast.campaign.discovery import find_campaigns
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.workspace import shown

_log = logging.getLogger(__name__)


@examples(
    ("vast results metadata", "Describe all campaigns of the project"),
    ("vast results metadata -r results/hall-2026-03-04-152130 --dot-pdf", "Also draw the graph"),
)
def metadata(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    no_plugins: Annotated[
        bool, typer.Option("--no-plugins", help="Skip plugins from files of the campaigns.")
    ] = False,
    dot_pdf: Annotated[
        bool,
        typer.Option(
            "--dot-pdf", help="Drawing of the graph: metadata.dot and, with Graphviz, metadata.pdf."
        ),
    ] = False,
) -> ExitCode:
    """Write metadata.yaml and the provenance graph of campaigns.

    The graph is metadata.prov.json, in PROV-O. Missing data, such as the verdict of an aborted run,
    is reported on stderr. All other data is written.
    """
    code = ExitCode.OK
    for campaign in find_campaigns(results_dir or ctx.obj.results):
        try:
            with progress_line(f"Describing {shown(campaign)}"):
                describe(campaign, own_plugins=not no_plugins)
                if dot_pdf:
                    write_drawing(campaign)
        except RobovastError as error:
            _log.error("%s", error)
            code = error.exit_code
        else:
            drawn = ", metadata.dot, metadata.pdf" if dot_pdf else ""
            echo(f"{shown(campaign)}: metadata.yaml, metadata.prov.json{drawn}")
    return code
