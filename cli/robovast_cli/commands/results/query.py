"""`vast results query`: ask the tables of campaigns."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robovast_cli.commands.results.buckets import Buckets, Context, Namespace
from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
from robovast_cli.lazy import new_app

if TYPE_CHECKING:
    from robovast.analysis.tables.stored import StoredTables

app = new_app("Ask the tables of campaigns with SQL.")


@app.command()
def query(
    ctx: typer.Context,
    sql: Annotated[
        str | None,
        typer.Argument(
            metavar="SQL|-",
            help="A query, or `-` for standard input; the tables are listed when omitted.",
            show_default=False,
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: AnswerFormat = "table",
    bucket: Buckets = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Ask the tables of campaigns with SQL.

    `runs` has a row for each run: parameters (`param_…`), factors (`factor_…`), verdict, times,
    metrics. Each CSV name of the runs is a table of its own. Nothing can be changed. A query may
    take any time; Ctrl-C ends it.

    With --bucket nothing is downloaded but the parts of the tables that the query needs. All runs
    must have ended; tables other than `runs` are there when results were processed in the cluster.

    Example: vast results query "SELECT config, avg(duration) FROM runs GROUP BY config"
    """
    if bucket:
        from robovast_cli.commands.results.buckets import opened

        with opened(bucket, context, namespace) as found:
            _answer([one.tables() for one in found], sql, output)
        return
    from robovast.campaign.finding import find_campaigns

    _answer(find_campaigns(results_dir or ctx.obj.results), sql, output)


def _answer(
    campaigns: Sequence[Path | StoredTables], sql: str | None, output: AnswerFormat
) -> None:
    """Print the tables of campaigns, or the answer of a query."""
    from robovast.analysis.tables.query import ask, tables
    from robovast.base.signals import end_at_ctrl_c
    from robovast_cli.ui.rows import print_rows, print_tables

    if sql is None:
        print_tables(tables(campaigns))
        return
    text = sys.stdin.read() if sql == "-" else sql
    with end_at_ctrl_c():
        answer = ask(campaigns, text)
    print_rows(answer, output)
