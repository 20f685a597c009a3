"""`vast results search`: what a search found."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer

from robovast_cli.commands.results.options import AnswerFormat, CampaignName, ResultsDir
from robovast_cli.lazy import new_app

app = new_app("Say what a search found: its sets, its progress, where it begins to fail.")


@app.command()
def search(
    ctx: typer.Context,
    campaign: CampaignName,
    what: Annotated[
        Literal["sets", "best", "progress", "critical", "map", "archive"],
        typer.Argument(
            help="All sets with their numbers; the best one, or those that no other beats; the "
            "strategy's numbers after each batch; the critical value of each parameter; the "
            "failure rate all over the space; the best set of each cell of an archive.",
        ),
    ] = "sets",
    results_dir: ResultsDir = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="With `critical`: a parameter's value where the middle of the space is not meant. "
            "May be repeated.",
            show_default=False,
        ),
    ] = None,
    output: AnswerFormat = "table",
) -> None:
    """Say what a search found, finished or under way.

    `critical` and `map` need the strategy `boundary`, `archive` needs `qd`. A critical value is
    where the failure rate crosses the level as one parameter grows and the others stay; `crossing`
    is the probability that it does at all.
    """
    from robovast.base.errors import InputError
    from robovast.search.results import StoredSearch
    from robovast_cli.commands.results.options import named_campaign
    from robovast_cli.ui.rows import print_rows

    if at and what != "critical":
        raise InputError(f"--at belongs to `critical`, not to `{what}`.")
    stored = StoredSearch(named_campaign(results_dir or ctx.obj.results, campaign))
    answers = {
        "sets": stored.sets,
        "best": stored.best,
        "progress": stored.report,
        "critical": lambda: stored.critical(dict(map(_pair, at or []))),
        "map": stored.map,
        "archive": stored.archive,
    }
    print_rows(answers[what](), output)


def _pair(text: str) -> tuple[str, Any]:
    """Name and value of `name=value`."""
    import yaml

    from robovast.base.errors import InputError

    name, separator, value = text.partition("=")
    if not separator:
        raise InputError(f"--at {text}: must be `NAME=VALUE`.")
    try:
        return name, yaml.safe_load(value)
    except yaml.YAMLError:
        raise InputError(f"--at {text}: the value is not valid.") from None
