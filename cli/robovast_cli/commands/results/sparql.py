"""`vast results sparql`: ask the provenance graphs of campaigns."""

import os
from typing import Annotated

import typer

from robovast_cli.commands.results.buckets import Buckets, Context, Namespace
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
    bucket: Buckets = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Ask the provenance graphs of campaigns with SPARQL.

    The prefixes rdf, rdfs, xsd, prov, dcterms, dcat, foaf, robovast, smm, scenarios, env, agn, qudt
    and unit need not be declared. A table has IRIs relative to the campaign, CSV and JSON have
    complete ones. With --bucket only the graphs are downloaded, which results
    processing in the cluster makes.
    """
    from robovast.base.errors import InputError
    from robovast.campaign.finding import find_campaigns
    from robovast.model.naming import GRAPH
    from robovast_cli.ui.answers import print_answer, print_query_names

    if list_queries or query is None:
        print_query_names()
        return
    if not bucket:
        print_answer(query, find_campaigns(results_dir or ctx.obj.results), output)
        return
    from robovast_cli.commands.results.buckets import opened

    with opened(bucket, context, namespace) as found:
        folders = [one.bring(GRAPH) for one in found]
        if not any(os.path.isfile(folder / GRAPH) for folder in folders):
            raise InputError(
                f"no graph is stored of {', '.join(bucket)}: results processing in the cluster "
                "makes it (`spec.processResults: true` of the Campaign). To make it here: "
                "`vast results download`, then `vast results postprocess`."
            )
        print_answer(query, folders, output)
