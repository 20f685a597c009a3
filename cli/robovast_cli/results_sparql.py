"""`vast results sparql`: ask the provenance graphs of campaigns."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.lazy import new_app

app = new_app("Ask the provenance graphs of campaigns with SPARQL.")


@app.command()
def sparql(
    ctx: typer.Context,
    query: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE|-",
            help="A query of the package, a file with one, or `-` for standard input.",
            show_default=False,
        ),
    ] = None,
    results_dir: Annotated[
        Path | None,
        typer.Option(
            "-r",
            "--results-dir",
            metavar="PATH",
            help="Folder of campaigns, or one campaign; the project's results folder when omitted.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Literal["table", "csv", "json"],
        typer.Option("-o", "--output", help="How to print the answer."),
    ] = "table",
    list_queries: Annotated[
        bool, typer.Option("--list", help="List the queries of the package and exit.")
    ] = False,
) -> None:
    """Ask the provenance graphs of campaigns with SPARQL.

    The prefixes rdf, rdfs, xsd, prov, dcterms, dcat, foaf, robovast, smm, scenarios, env, agn, qudt
    and unit need not be declared.
    """
    from robovast_cli.answers import print_answer, print_query_names

    if list_queries or query is None:
        print_query_names()
        return
    print_answer(query, results_dir or ctx.obj.results, output)
