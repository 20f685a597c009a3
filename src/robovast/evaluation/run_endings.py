"""How a run ended: its last log lines, and the way that it drove last."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.base.errors import InputError, RobovastError
from robovast.campaign.verdict import Verdict
from robovast.evaluation.logs import LogLine, LogPage, question_of_run, read_log
from robovast.evaluation.map_picture import draw_map, has_map
from robovast.evaluation.poses import Way, last_position, way
from robovast.evaluation.run import logs_of, run_record
from robovast.evaluation.summaries import RunSummary, VariantRuns

if TYPE_CHECKING:
    from robovast.navigation.drawing import Mark

LAST_LINES = 12
"""Lines of a log."""
BEFORE = 2
"""Lines before an error."""
NO_WAY = "no trajectory, because the run has no poses.csv (written by postprocessing)"
_COMMAND = "[robovast] job "
"""Start of the line with a job's command, which is long and does not explain the end."""
_MOST_LOGS = 5
_MOST_RUNS = 100
"""Runs of a configuration whose ends are drawn."""
_WAY, _END = "#7c3aed", "#dc2626"
_BOLD = 6
_CROSS = 0.12
"""Radius of an end [m]."""


@dataclass(frozen=True)
class LogEnd:
    """The end of a log."""

    path: str
    """The log, relative to the results folder."""
    error: list[LogLine]
    """The first error and the lines before it, where it is not among the last lines."""
    lines: list[LogLine]
    """The last lines."""


def log_end(results: Path, campaign: str, run: str) -> LogEnd | None:
    """The end of a run's log: of several, of the first with an error; None without a log.

    Args:
        results: the results folder, without links.
        campaign: name of the campaign.
        run: configuration and number, such as `hall-1/0`.
    """
    place = f"{campaign}/{run}"
    record = run_record(results, place)
    found = None
    try:
        paths, packed = logs_of(results, campaign, place, record)
        for path in paths[:_MOST_LOGS]:
            page = read_log(results, path, question_of_run(record, "", packed))
            if page.error is not None:
                return _end_of(path, page)
            found = found or (_end_of(path, page) if page.lines else None)
    except InputError:  # gone meanwhile, or not to be read
        return found
    return found


def _end_of(path: str, page: LogPage) -> LogEnd:
    lines = [line for line in page.lines if not line.text.startswith(_COMMAND)][-LAST_LINES:]
    first = page.error
    if first is None or not lines or first >= lines[0].number:
        return LogEnd(path, [], lines)
    error = [line for line in page.lines if first - BEFORE <= line.number <= first]
    return LogEnd(path, error, lines)


def worst_run(variant: VariantRuns) -> RunSummary | None:
    """The first run of a configuration that failed, or else errored; None if all others passed."""
    for verdict in (Verdict.FAILED, Verdict.ERRORED):
        found = next((run for run in variant.runs if run.verdict is verdict), None)
        if found is not None:
            return found
    return None


def draw_ending(results: Path, campaign: str, variant: VariantRuns, run: int) -> tuple[str, str]:
    """A configuration on its map with the way of a run, and where its bad runs ended, as SVG.

    Returns:
        The picture, and what is missing: it, or the way; both are empty without a map.
    """
    if not has_map(results, campaign, variant.name):
        return "", ""
    driven = way(results, f"{campaign}/{variant.name}/{run}")
    try:
        marks = _marks(results, campaign, variant, driven)
        return draw_map(results, campaign, variant.name, marks), NO_WAY if driven is None else ""
    except RobovastError as error:
        return "", str(error)


def _marks(results: Path, campaign: str, variant: VariantRuns, driven: Way | None) -> list[Mark]:
    from robovast.base.optional_deps import NAV

    with NAV.needed_by("The picture of a configuration"):
        from robovast.navigation.drawing import Disc, Line
    place = f"{campaign}/{variant.name}"
    bad = [run for run in variant.runs if run.verdict in (Verdict.FAILED, Verdict.ERRORED)]
    ends = [last_position(results, f"{place}/{run.number}") for run in bad[:_MOST_RUNS]]
    found: list[Mark] = []
    if driven is not None:
        found = [Line(places, _WAY) for places in driven.episodes]
        found.append(Line(driven.episodes[-1][driven.last :], _END, _BOLD))
    return [*found, *(Disc(end, _CROSS, _END, "×") for end in ends if end is not None)]
