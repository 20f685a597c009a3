"""`vast results sparql`: query the provenance graphs of campaigns."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from robovast.analysis.provenance.query import Graphs, query_names, read_query
from robovast.analysis.provenance.vocabulary import PREFIXES
from robovast.base.errors import InputError
from robovast.base.file_errors import read_text
from robovast.campaign.discovery import find_campaigns
from robovast.model.naming import GRAPH
from robovast_cli.commands.results.buckets import Buckets, Context, Namespace, open_campaigns
from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo_data
from robovast_cli.ui.rows import cell_text, print_rows
from robovast_cli.ui.table import format_table


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
    if list_queries or query is None:
        sys.stdout.write(format_table(["NAME", "DESCRIPTION"], query_names().items()))
        return
    if not bucket:
        _print_answer(query, find_campaigns(results_dir or ctx.obj.results), output)
        return
    with open_campaigns(bucket, context, namespace) as found:
        folders = [one.fetch(GRAPH) for one in found]
        if not any(os.path.isfile(folder / GRAPH) for folder in folders):
            raise InputError(
                f"no graph is stored for {', '.join(bucket)}",
                hint="set `spec.processResults: true` in the Campaign, so that the cluster "
                "writes the graph. To write it on this machine, run `vast results "
                "download`, then `vast results postprocess`",
            )
        _print_answer(query, folders, output)


def _print_answer(query: str, campaigns: Sequence[Path], output: AnswerFormat) -> None:
    text = _read(query)
    graphs = Graphs(campaigns)
    answer = graphs.ask(text)
    if output == "csv":
        echo_data(answer.csv())
    else:
        print_rows(answer.columns, answer, output, _shortener(graphs))


def _read(query: str) -> str:
    if query in query_names():
        return read_query(query)
    if query == "-":
        try:
            return sys.stdin.read()
        except UnicodeDecodeError:
            raise InputError("-: is not text in UTF-8.", hint="save the text in UTF-8") from None
    path = Path(query)
    return read_text(path) if path.is_file() else read_query(query)


def _shortener(graphs: Graphs) -> Callable[[Any], str]:
    """Return a function that shortens IRIs: relative to the campaign, or with a prefix."""
    bases = list(graphs.campaigns)
    names = {iri: f"{folder.absolute().name}/" for iri, folder in graphs.campaigns.items()}
    short = {bases[0]: ""} if len(bases) == 1 else names

    def shorten(value: Any) -> str:
        if not isinstance(value, str):
            return cell_text(value)
        base = next((base for base in bases if value.startswith(base)), None)
        if base is not None:
            return short[base] + value.removeprefix(base) or "."
        prefix = next((p for p, iri in PREFIXES.items() if value.startswith(iri)), None)
        return f"{prefix}:{value.removeprefix(PREFIXES[prefix])}" if prefix else value

    return shorten
