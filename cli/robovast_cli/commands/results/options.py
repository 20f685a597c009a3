"""Options that several commands on results share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast.base.errors import InputError

ResultsDir = Annotated[
    Path | None,
    typer.Option(
        "-r",
        "--results-dir",
        metavar="PATH",
        help="Folder of campaigns, or one campaign; the project's results folder when omitted.",
        show_default=False,
    ),
]

AnswerFormat = Annotated[
    Literal["table", "csv", "json"],
    typer.Option("-o", "--output", help="How to print the answer."),
]

Campaigns = Annotated[
    list[str] | None,
    typer.Option(
        "-i",
        "--campaign",
        metavar="NAME",
        help="Only this campaign, by the name of its folder. May be repeated; all when omitted.",
        show_default=False,
    ),
]


def chosen_campaigns(results: Path, names: list[str] | None) -> list[Path]:
    """Folders of the named campaigns in a results folder, or of all.

    Raises:
        InputError: there is none, or none of a name.
    """
    from robovast.campaign.finding import find_campaigns

    found = {path.absolute().name: path for path in find_campaigns(results)}
    unknown = [name for name in names or [] if name not in found]
    if unknown:
        raise InputError(
            f"there is no campaign `{unknown[0]}` in {results}; it has {', '.join(found)}."
        )
    return [found[name] for name in dict.fromkeys(names)] if names else list(found.values())
