"""`vast results search`: results of a search."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from robovast.base.atomic import write_report
from robovast.base.errors import InputError
from robovast.base.optional_deps import ANALYSIS
from robovast.base.yaml_files import parse_yaml
from robovast.model.document.search.space import Space, choices
from robovast_cli.commands.results.options import (
    AnswerFormat,
    CampaignName,
    ResultsDir,
    named_campaign,
)
from robovast_cli.lazy import examples
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.rows import print_rows

if TYPE_CHECKING:
    from robovast.search.results import StoredSearch


@examples(
    ("vast results search results/drone-2026-03-04-152130", "List the parameter sets"),
    ("vast results search drone-2026-03-04-152130 best", "Show the best set"),
    ("vast results search drone-2026-03-04-152130 critical --at boxes=3", "Show critical values"),
)
def search(
    ctx: typer.Context,
    campaign: CampaignName,
    what: Annotated[
        Literal["sets", "best", "progress", "critical", "map", "archive"],
        typer.Argument(
            metavar="VIEW",
            show_default=False,
            help="sets: all parameter sets with their scores. best: the best set, or the Pareto "
            "front. progress: numbers of the strategy after each batch. critical: critical value "
            "of each parameter. map: failure rate in the whole space. archive: best set of each "
            "cell (default: sets).",
        ),
    ] = "sets",
    results_dir: ResultsDir = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="Value of a parameter for `critical` and `map --picture` (default: middle of the "
            "space) (repeatable).",
        ),
    ] = None,
    output: AnswerFormat = "table",
    picture: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Image file (.png or .svg) for `map` or `progress`."),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Dimension to draw with `map --picture`. Give two (default: the first two) "
            "(repeatable).",
        ),
    ] = None,
) -> None:
    """Show the results of a search.

    The search may still be running. `critical` and `map` require the strategy `boundary`. `archive`
    requires the strategy `qd`.

    At the critical value of a parameter, the failure rate crosses the `level` of the strategy while
    the other parameters are constant. `above` is the expected result above this value. `crossing`
    is the probability of a crossing. `open` lists the ends of the interval that are on the border
    of the search space. At these ends, the critical value may be outside the space.
    """
    if picture is not None and what not in {"map", "progress"}:
        raise InputError(
            f"--picture requires `map` or `progress`, not `{what}`.",
            hint="use `vast results search map --picture FILE`",
        )
    if over and not (picture and what == "map"):
        raise InputError(
            "--over requires `map` with --picture.",
            hint="use `vast results search map --picture FILE`",
        )
    if at and what != "critical" and not (picture and what == "map"):
        raise InputError(
            f"--at requires `critical`, or `map` with --picture, not `{what}`.",
            hint="use `vast results search critical`, or `map` with `--picture FILE`",
        )
    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    with progress_line(f"Reading {folder.name}") as show:
        from robovast.search.results import stored_search

        stored = stored_search(folder)
        fixed = dict(_pair(text, stored.search.search_space) for text in at or ())
        answers = {
            "sets": stored.sets,
            "best": stored.best,
            "progress": stored.report,
            "critical": lambda: stored.critical(fixed),
            "map": stored.map,
            "archive": stored.archive,
        }
        show(f"computing `{what}`")
        if picture is not None:
            _draw(stored, picture, None if what == "progress" else (over or []), fixed)
            return
        answer = answers[what]()
    print_rows(answer.columns, answer.rows, output)


def _draw(
    stored: StoredSearch, picture: Path, over: list[str] | None, fixed: dict[str, Any]
) -> None:
    """Write an image of the map over dimensions, or of the progress."""
    with ANALYSIS.needed_by("Drawing"):
        from robovast.search.pictures import draw_map, draw_progress, encoded
    figure = draw_progress(stored) if over is None else draw_map(stored, over, fixed)
    write_report(picture, encoded(figure, picture))


def _pair(text: str, space: Space) -> tuple[str, Any]:
    """Name and value of `name=value`; the value of a choice is found by its text."""
    name, separator, value = text.partition("=")
    if not separator:
        raise InputError(
            f"--at {text}: must be `NAME=VALUE`.", hint="use for example `--at speed=0.5`"
        )
    listed = (choices(space[name]) or []) if name in space else []
    try:
        return name, next((one for one in listed if str(one) == value), parse_yaml(value))
    except ValueError:
        raise InputError(
            f"--at {text}: the value is not valid YAML", hint="write the value as in a .vast file"
        ) from None
