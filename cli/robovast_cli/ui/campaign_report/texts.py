"""Texts that the HTML and the Markdown report share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from robovast.base.statistics import LEVEL, percent
from robovast.campaign.log_lines import parse_line
from robovast.evaluation.campaign_report import CampaignReport, Worst
from robovast.evaluation.factors import Explained
from robovast.evaluation.logs import LogLine
from robovast.evaluation.matrix import Cell, value_label
from robovast.evaluation.poses import LAST_SECONDS
from robovast.evaluation.rates import VariantRate
from robovast_cli.ui.summary import CHANCE, COLUMNS, configuration_row
from robovast_cli.ui.table import shortened

MOST_CAUSES = 20
MOST_ROWS = 30
"""Configurations in a table."""
MOST_FACTORS = 12
WIDEST = 60
"""Characters of a value."""
WIDEST_LINE = 300
"""Characters of a line of a log or a file."""
LONGEST_TEXT = 1_000
"""Characters of a description or a reason."""
MOST_CHANGES, MOST_CHANGED_LINES = 8, 40
"""Files that differ from those of the baseline, and lines of each."""
MAP_KEY = "blue: planned path"
WAY_KEY = f"violet: trajectory; red: its last {LAST_SECONDS:g} s; ×: end of an unsuccessful run"


def facts(report: CampaignReport) -> str:
    """Return the name, state, start, duration and image of a campaign."""
    summary = report.rates.summary
    started = summary.started_at
    image = summary.execution.get("image")
    found = (
        summary.name,
        summary.state,
        None if started is None else f"{datetime.fromtimestamp(started, UTC):%Y-%m-%d %H:%M} UTC",
        None if summary.duration is None else duration(summary.duration),
        image if isinstance(image, str) else None,
    )
    return " · ".join(shortened(text, LONGEST_TEXT) for text in found if text)


def duration(seconds: float) -> str:
    """`42 s`, `3 min 20 s`, `2 h 5 min`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def axes_note(explained: Explained) -> str:
    """Explain the choice of the axes of the matrix."""
    if not explained.axes:
        return "The campaign varies no parameters."
    names = " and ".join(explained.axes)
    if not explained.effects:
        return f"No factor separates failures. The axes are the first factors: {names}."
    ps = [effect.p for effect in explained.effects if effect.factor in explained.axes]
    verb = "separate" if len(explained.axes) > 1 else "separates"
    if all(p < LEVEL for p in ps):
        return f"{names} {verb} failures best."
    if any(p < LEVEL for p in ps):
        return f"{names} {verb} failures best, but chance can explain one of them."
    noun = "axes are" if len(explained.axes) > 1 else "axis is"
    return f"The {noun} {names}. {CHANCE.strip()}"


def titled(factor: str, units: Mapping[str, str]) -> str:
    """A factor with its unit."""
    unit = units.get(factor)
    return shortened(f"{factor} [{unit}]" if unit else factor, WIDEST)


def values(worst: Worst) -> dict[str, str]:
    """Return the values of the factors of a configuration."""
    shown = list(worst.variant.factors.items())[:MOST_FACTORS]
    units = worst.variant.units
    return {titled(name, units): shortened(value_label(value), WIDEST) for name, value in shown}


def configuration_table(bad: Sequence[VariantRate]) -> list[list[str]]:
    """Columns and rows of the worst configurations, with the reason next to the name."""
    rows = [COLUMNS, *map(configuration_row, bad[:MOST_ROWS])]
    return [[name, reason, *cells] for name, *cells, reason in rows]


def run_facts(worst: Worst) -> str:
    """Describe the shown run, and count the unsuccessful runs of its configuration."""
    rate = worst.rate.rate
    bad = f"{rate.failed + rate.errored} of {rate.runs} runs were unsuccessful"
    took = "" if worst.run.duration is None else f" after {duration(worst.run.duration)}"
    reason = shortened(worst.run.reason, LONGEST_TEXT) or "unknown reason"
    return f"{bad}. Run {worst.run.number} {worst.run.verdict}{took}: {reason}"


def log_line(line: LogLine, started: float | None) -> str:
    """A line of a log, with the seconds since the start of the run in place of the time."""
    message = parse_line(line.text)
    if not message.levels:
        return shortened(line.text, WIDEST_LINE)
    seconds = ""
    if message.stamp is not None and started is not None:
        seconds = f"{message.stamp - started:8.3f} s  "
    source = f"{message.source}: " if message.source else ""
    return shortened(f"{seconds}{message.level.upper():5} {source}{message.text}", WIDEST_LINE)


def log_lines(worst: Worst) -> list[tuple[LogLine | None, str]]:
    """Lines of a run's log with their text; None for omitted lines."""
    ending = worst.ending
    if ending is None:
        return []
    started = worst.run.started_at
    texts = [(line, log_line(line, started)) for line in ending.error]
    gap = [(None, "…")] if texts else []
    return [*texts, *gap, *((line, log_line(line, started)) for line in ending.lines)]


def cell_text(cell: Cell) -> str:
    """Return the rate of unsuccessful runs of a cell."""
    return f"{percent(cell.bad / cell.runs)} ({cell.bad}/{cell.runs})" if cell.runs else ""
