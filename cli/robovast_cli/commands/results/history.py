"""`vast results history`: one configuration in all campaigns."""

from __future__ import annotations

import os
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from robovast.base.statistics import interval_text, percent
from robovast.evaluation.configuration_index import default_index
from robovast.evaluation.history import History, HistoryEntry, latest_with
from robovast.evaluation.history import history as collect_history
from robovast.evaluation.rates import Rate
from robovast.model.naming import holds_campaign
from robovast_cli.commands.results.options import ReportFormat, ResultsDir, named_campaign
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo_data, echo_json
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.table import WIDEST_REASON, counted, format_table, shortened

_COLUMNS = ["STARTED", "", "UNSUCCESSFUL", "RATE", "95 % INTERVAL", "CHANGED", "CAMPAIGN", "REASON"]
_ALL, _SOME, _NONE = "○◐●"
"""As in the web UI, a dot is filled in proportion to the unsuccessful runs."""


@examples(
    ("vast results history hall-3", "Use the name in the latest campaign"),
    ("vast results history hall-3 -i hall-2026-03-04-152130 -o json", "Print JSON"),
)
def history(
    ctx: typer.Context,
    configuration: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG",
            help="Folder of a configuration, or its name in the latest campaign that contains it.",
        ),
    ],
    campaign: Annotated[
        str | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Campaign in which the configuration has this name (default: the latest).",
        ),
    ] = None,
    results_dir: ResultsDir = None,
    output: ReportFormat = "text",
) -> None:
    """Show the failure rate of a configuration in each campaign.

    Lists the oldest campaign first, and shows which inputs changed in each campaign. Inputs are the
    image, environment, RoboVAST version, seed, parameters, scenario, .vast file, and other files of
    the campaign and the configuration.

    A configuration is recognized by its parameters, even under another name. Without parameters,
    it is recognized by its name.
    """
    results, name = (results_dir or ctx.obj.results).resolve(), configuration.rstrip("/")
    folder = Path(os.path.realpath(name))
    if campaign is None and holds_campaign(folder.parent):
        results, campaign, name = folder.parent.parent, folder.parent.name, folder.name
    elif campaign is not None:
        named = named_campaign(results, campaign)
        results, campaign = named.parent, named.name
    elif holds_campaign(results):
        results, campaign = results.parent, results.name
    with progress_line("Searching campaigns") as show:
        found = collect_history(
            results,
            campaign or latest_with(results, name),
            name,
            default_index(),
            progress=lambda other, place, total: show(f"{other}, {place} of {total} campaigns"),
        )
    if output == "json":
        echo_json({"configuration": name, **asdict(found)})
    else:
        echo_data(_text(name, found))


def _text(name: str, found: History) -> str:
    table = format_table(_COLUMNS, map(_row, found.entries))
    dots = "".join(_dot(entry.rate) for entry in found.entries)
    lines = [
        f"{name}  {dots}  in {counted(len(found.entries), 'campaign')}",
        f"{_ALL} all passed, {_SOME} some passed, {_NONE} none passed",
    ]
    if found.others:
        others = counted(len(found.others), "other campaign")
        lines.append(f"In {others}, {name} has other parameters.")
    return "\n".join([f"{table}", *lines]) + "\n"


def _row(entry: HistoryEntry) -> list[str]:
    rate = entry.rate
    started = entry.started_at
    return [
        "–" if started is None else f"{datetime.fromtimestamp(started, UTC):%Y-%m-%d %H:%M}",
        _dot(rate),
        f"{rate.failed + rate.errored} of {rate.runs}",
        "–" if rate.rate is None else percent(rate.rate),
        interval_text(rate.interval),
        shortened(entry.changed, WIDEST_REASON),
        f"{entry.campaign}/{entry.name}",
        shortened(entry.reason, WIDEST_REASON),
    ]


def _dot(rate: Rate) -> str:
    bad = rate.failed + rate.errored
    if not bad:
        return _ALL
    return _NONE if bad == rate.runs else _SOME
