"""`vast results metadata`: metadata.yaml and the provenance graph of campaigns."""

from typing import Annotated

import typer

from robovast.base.errors import ExitCode
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Write metadata.yaml and the provenance graph of campaigns.")


@app.command()
def metadata(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    no_plugins: Annotated[
        bool,
        typer.Option(
            "--no-plugins",
            help="Execute no plugins in the campaigns' own files.",
        ),
    ] = False,
    dot_pdf: Annotated[
        bool,
        typer.Option(
            "--dot-pdf", help="Also draw the graph: metadata.dot and, with Graphviz, metadata.pdf."
        ),
    ] = False,
) -> ExitCode:
    """Write metadata.yaml and metadata.prov.json (PROV-O) of campaigns.

    What is missing in a campaign, as the verdict of an aborted run, is stated on stderr; all else
    is written.
    """
    from robovast_cli.commands.config.descriptions import describe_campaigns

    results = results_dir or ctx.obj.results
    return describe_campaigns(results, own_plugins=not no_plugins, draw=dot_pdf)
