"""`vast results query`: ask the tables of campaigns."""

import sys
from typing import Annotated

import typer

from robovast_cli.commands.results.options import AnswerFormat, ResultsDir
from robovast_cli.lazy import new_app

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
) -> None:
    """Ask the tables of campaigns with SQL.

    `runs` has a row for each run: parameters (`param_…`), factors (`factor_…`), verdict, times,
    metrics. Each CSV name of the runs is a table of its own. Nothing can be changed. A query may
    take any time; Ctrl-C ends it.

    Example: vast results query "SELECT config, avg(duration) FROM runs GROUP BY config"
    """
    from robovast.analysis.tables.query import ask, tables
    from robovast.base.signals import end_at_ctrl_c
    from robovast.campaign.finding import find_campaigns
    from robovast_cli.ui.rows import print_rows, print_tables

    campaigns = find_campaigns(results_dir or ctx.obj.results)
    if sql is None:
        print_tables(tables(campaigns))
        return
    text = sys.stdin.read() if sql == "-" else sql
    with end_at_ctrl_c():
        answer = ask(campaigns, text)
    print_rows(answer, output)
