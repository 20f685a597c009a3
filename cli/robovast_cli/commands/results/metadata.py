"""`vast results metadata`: metadata.yaml and the provenance graph of campaigns."""

from typing import Annotated

import typer

from robovast.base.errors import ExitCode
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples, new_app

app = new_app("Write metadata.yaml and the provenance graph of campaigns.")


@app.command()
@examples(
    ("vast results metadata", "Describe all campaigns of the project"),
    ("vast results metadata -r results/hall-2026-03-04-152130 --dot-pdf", "Also draw the graph"),
)
def metadata(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    no_plugins: Annotated[
        bool,
        typer.Option(
            "--no-plugins",
            help="Skip plugins from files of the campaigns.",
        ),
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
    from robovast_cli.commands.config.descriptions import describe_campaigns

    results = results_dir or ctx.obj.results
    return describe_campaigns(results, own_plugins=not no_plugins, draw=dot_pdf)
