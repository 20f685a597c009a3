"""`vast results sparql`: query the provenance graphs of campaigns."""

import os
from typing import Annotated

import typer

from robovast_cli.commands.results.buckets import Buckets, Context, Namespace
from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
from robovast_cli.lazy import examples


@examples(
    ("vast results sparql --list", "List the included queries"),
    ("vast results sparql failure-rate -r results", "Run an included query"),
    ("vast results sparql my-query.rq -o json", "Run a query from a file"),
)
def sparql(
    ctx: typer.Context,
    query: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE|-",
            help="Name of an included query, file with a query, or `-` for standard input.",
            show_default=False,
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: AnswerFormat = "table",
    list_queries: Annotated[
        bool, typer.Option("--list", help="List the included queries and exit.")
    ] = False,
    bucket: Buckets = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Query the provenance graphs of campaigns with SPARQL.

    The prefixes rdf, rdfs, xsd, prov, dcterms, dcat, foaf, robovast, smm, scenarios, env, agn, qudt
    and unit are predeclared. Tables contain IRIs relative to the campaign. CSV and JSON contain
    complete IRIs. --bucket downloads only the graphs, which exist if the cluster has postprocessed
    the results.
    """
    from robovast.base.errors import InputError
    from robovast.campaign.discovery import find_campaigns
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
                f"no graph is stored for {', '.join(bucket)}",
                hint="set `spec.processResults: true` in the Campaign, so that the cluster "
                "writes the graph. To write it on this machine, run `vast results "
                "download`, then `vast results postprocess`",
            )
        print_answer(query, folders, output)
