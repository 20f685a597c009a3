"""Options that several commands on results share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from robovast.base.errors import InputError
from robovast_cli.ui.report import echo_stderr

if TYPE_CHECKING:
    from robovast.evaluation.campaign_index import CampaignIndex

ResultsDir = Annotated[
    Path | None,
    typer.Option(
        "-r",
        "--results-dir",
        metavar="PATH",
        help="Folder of campaigns or of one campaign (default: the project's results folder).",
    ),
]

Target = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="PATH",
        help="Folder that receives the campaign's folder (default: the project's results folder).",
    ),
]

AnswerFormat = Annotated[
    Literal["table", "csv", "json"], typer.Option("-o", "--output", help="Output format.")
]

ReportFormat = Annotated[
    Literal["text", "json"], typer.Option("-o", "--output", help="Output format.")
]

CampaignName = Annotated[
    str,
    typer.Argument(
        metavar="CAMPAIGN", help="Folder of a campaign, or its name in the results folder."
    ),
]

Campaigns = Annotated[
    list[str] | None,
    typer.Option(
        "-i",
        "--campaign",
        metavar="NAME",
        help="Campaign, by the name of its folder (default: all) (repeatable).",
    ),
]


def chosen_campaigns(results: Path, names: list[str] | None) -> list[Path]:
    """Folders of the named campaigns in a results folder, or of all.

    Raises:
        InputError: the folder contains no campaign, or a name is unknown.
    """
    from robovast.campaign.discovery import find_campaigns

    found = {path.absolute().name: path for path in find_campaigns(results)}
    unknown = [name for name in names or [] if name not in found]
    if unknown:
        raise InputError(
            f"no campaign `{unknown[0]}` in {results}", hint=f"use one of {', '.join(found)}"
        )
    return [found[name] for name in dict.fromkeys(names)] if names else list(found.values())


def named_campaign(results: Path, name: str | None) -> Path:
    """Folder of one campaign, by its path or by its name in a results folder; without links.

    Without a name, it is the only campaign of the results folder.

    Raises:
        InputError: there is none, or the folder holds several.
    """
    from robovast.campaign.discovery import find_campaigns

    if name is None:
        if not os.path.lexists(results):
            raise InputError(
                f"there are no campaigns yet: the results folder {results} does not exist",
                hint="run `vast exec local run`, or name another results folder with `-r`",
            )
        name = str(results)
    candidates = [path for path in (Path(name), results / name) if os.path.isdir(path)]
    if not candidates:
        raise InputError(
            f"no campaign `{name}`: neither this folder nor {results}/{name} exists",
            hint="name the folder of a campaign, or set the results folder with `-r`",
        )
    found = find_campaigns(candidates[0])
    if len(found) > 1:
        names = ("… " if len(found) > 5 else "") + ", ".join(path.name for path in found[-5:])
        raise InputError(
            f"{name} contains {len(found)} campaigns ({names})", hint="name one of them"
        )
    return found[0].resolve()


def read_campaign(folder: Path) -> CampaignIndex:
    """Return a campaign with all its runs; warn of folders that are not runs but look like runs.

    Raises:
        InputError: it cannot be read, or it has no runs.
    """
    from robovast.campaign.layout import Layout
    from robovast.evaluation.campaign_index import CampaignIndex

    for run in Layout(folder).misnumbered_runs():
        echo_stderr(
            f"warning: {run} is not counted: the number of a run has at most nine digits and no "
            "leading zeros. Rename the folder."
        )
    index = CampaignIndex(folder.parent, folder.name)
    index.refresh()
    if not any(variant.runs for variant in index.variants):
        raise InputError(f"{folder.name} has no stored runs", hint="wait until a run has finished")
    return index
