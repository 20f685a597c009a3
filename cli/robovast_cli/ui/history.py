"""The history of a configuration as text or JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Literal

from robovast.base.printable import printable_json
from robovast.base.statistics import interval_text, percent
from robovast.evaluation.history import History, HistoryEntry
from robovast.evaluation.rates import Rate
from robovast_cli.ui.output import say_data
from robovast_cli.ui.table import WIDEST_REASON, format_table, shortened

Format = Literal["text", "json"]

_COLUMNS = ["STARTED", "", "UNSUCCESSFUL", "RATE", "95 % INTERVAL", "CHANGED", "CAMPAIGN", "REASON"]
_ALL, _SOME, _NONE = "○◐●"
"""As in the web UI, a dot is filled in proportion to the unsuccessful runs."""


def print_history(name: str, found: History, output: Format) -> None:
    """Print a configuration's history."""
    say_data(_json(name, found) if output == "json" else _text(name, found))


def _json(name: str, found: History) -> str:
    data = {"configuration": name, **asdict(found)}
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _text(name: str, found: History) -> str:
    table = format_table(_COLUMNS, map(_row, found.entries))
    dots = "".join(_dot(entry.rate) for entry in found.entries)
    noun = "campaign" if len(found.entries) == 1 else "campaigns"
    lines = [
        f"{name}  {dots}  in {len(found.entries)} {noun}",
        f"{_ALL} all passed, {_SOME} some passed, {_NONE} none passed",
    ]
    if found.others:
        noun = "campaign" if len(found.others) == 1 else "campaigns"
        lines.append(f"In {len(found.others)} other {noun}, {name} has other parameters.")
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
