"""`vast results sparql`: ask the provenance graphs of campaigns."""

from typing import Annotated

import typer

from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
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
    results_dir: ResultsDir = None,
    output: AnswerFormat = "table",
    list_queries: Annotated[
        bool, typer.Option("--list", help="List the queries of the package and exit.")
    ] = False,
) -> None:
    """Ask the provenance graphs of campaigns with SPARQL.

    The prefixes rdf, rdfs, xsd, prov, dcterms, dcat, foaf, robovast, smm, scenarios, env, agn, qudt
    and unit need not be declared.
    """
    from robovast_cli.ui.answers import print_answer, print_query_names

    if list_queries or query is None:
        print_query_names()
        return
    print_answer(query, results_dir or ctx.obj.results, output)
