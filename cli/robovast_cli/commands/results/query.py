"""`vast results query`: query the tables of campaigns."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from robovast.analysis.tables.query import ask, tables
from robovast.analysis.tables.stored import StoredTables
from robovast.base.signals import end_at_ctrl_c
from robovast.campaign.discovery import find_campaigns
from robovast_cli.commands.results.buckets import Buckets, Context, Namespace, open_campaigns
from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.rows import print_rows, print_tables


@examples(
    ("vast results query", "List tables and columns"),
    ('vast results query "SELECT config, avg(duration) FROM runs GROUP BY 1"', "Query run times"),
    ('vast results query "SELECT * FROM runs" -o csv', "Write CSV"),
)
def query(
    ctx: typer.Context,
    sql: Annotated[
        str | None,
        typer.Argument(
            metavar="SQL|-", help="Query, or `-` for standard input (default: list the tables)."
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: AnswerFormat = "table",
    bucket: Buckets = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Query the tables of campaigns with SQL.

    The table `runs` has a row for each run with its parameters (`param_…`), factors (`factor_…`),
    verdict, times and metrics. All CSV files with the same name form one table. Queries cannot
    change data. A query has no time limit. Ctrl-C stops it.

    --bucket downloads only the parts of the tables that the query needs. All runs must have
    finished. Tables other than `runs` exist only if the cluster has postprocessed the results.
    """
    if bucket:
        with open_campaigns(bucket, context, namespace) as found:
            _answer([one.tables() for one in found], sql, output)
        return
    _answer(find_campaigns(results_dir or ctx.obj.results), sql, output)


def _answer(
    campaigns: Sequence[Path | StoredTables], sql: str | None, output: AnswerFormat
) -> None:
    """Print the tables of campaigns, or the answer of a query."""
    if sql is None:
        print_tables(tables(campaigns))
        return
    text = sys.stdin.read() if sql == "-" else sql
    with end_at_ctrl_c():
        answer = ask(campaigns, text)
    print_rows(answer.columns, answer.rows, output)
