"""`vast results search`: what a search found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from robovast_cli.commands.results.options import AnswerFormat, CampaignName, ResultsDir
from robovast_cli.lazy import new_app

if TYPE_CHECKING:
    from robovast.model.document.search.space import Space
    from robovast.search.results import StoredSearch

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
            help="With `critical` and `map --picture`: a parameter's value where the middle of the "
            "space is not meant. "
            "May be repeated.",
            show_default=False,
        ),
    ] = None,
    output: AnswerFormat = "table",
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="With `map` or `progress`: draw it to this .png or .svg file instead.",
            show_default=False,
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="With `map --picture`: a dimension to draw; to be given twice. The first two "
            "when omitted.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Say what a search found, finished or under way.

    `critical` and `map` need the strategy `boundary`, `archive` needs `qd`. A critical value is
    where the failure rate crosses the level as one parameter grows and the others stay; `above`
    says what is to be expected beyond it, `crossing` how probable it is that it crosses at all,
    `open` which ends of the interval are ends of the space: the value may lie beyond them.
    """
    from robovast.base.errors import InputError
    from robovast_cli.commands.results.options import named_campaign
    from robovast_cli.ui.rows import print_rows
    from robovast_cli.ui.working import working

    if picture is not None and what not in {"map", "progress"}:
        raise InputError(f"--picture belongs to `map` and `progress`, not to `{what}`.")
    if over and not (picture and what == "map"):
        raise InputError("--over belongs to `map` with --picture.")
    if at and what != "critical" and not (picture and what == "map"):
        raise InputError(
            f"--at belongs to `critical`, and to `map` with --picture; not to `{what}`."
        )
    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    with working(f"Reading {folder.name}") as tell:
        from robovast.search.results import stored_search

        stored = stored_search(folder)
        fixed = _fixed(at, stored.search.search_space)
        answers = {
            "sets": stored.sets,
            "best": stored.best,
            "progress": stored.report,
            "critical": lambda: stored.critical(fixed),
            "map": stored.map,
            "archive": stored.archive,
        }
        tell(f"computing `{what}`")
        if picture is not None:
            _draw(stored, picture, None if what == "progress" else (over or []), fixed)
            return
        answer = answers[what]()
    print_rows(answer, output)


def _draw(
    stored: StoredSearch, picture: Path, over: list[str] | None, fixed: dict[str, Any]
) -> None:
    """Write a picture of the map over dimensions, or of the progress."""
    from robovast.base.atomic import write_report
    from robovast.base.optional_deps import ANALYSIS

    with ANALYSIS.needed_by("Drawing"):
        from robovast.search.pictures import draw_map, draw_progress, encoded
    figure = draw_progress(stored) if over is None else draw_map(stored, over, fixed)
    write_report(picture, encoded(figure, picture))


def _fixed(at: list[str] | None, space: Space) -> dict[str, Any]:
    return dict(_pair(text, space) for text in at or [])


def _pair(text: str, space: Space) -> tuple[str, Any]:
    """Name and value of `name=value`; the value of a choice is found by its text."""
    from robovast.base.errors import InputError
    from robovast.base.yaml_files import parse_yaml
    from robovast.model.document.search.space import choices

    name, separator, value = text.partition("=")
    if not separator:
        raise InputError(f"--at {text}: must be `NAME=VALUE`.")
    listed = (choices(space[name]) or []) if name in space else []
    try:
        return name, next((one for one in listed if str(one) == value), parse_yaml(value))
    except ValueError:
        raise InputError(f"--at {text}: the value is not valid.") from None
