"""Searches a text in the logs of many runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.base.errors import InputError
from robovast.campaign.log_lines import without_escapes
from robovast.evaluation.confined_files import open_inside
from robovast.evaluation.logs import PART, LogLine, question_of_run, read_log
from robovast.evaluation.run import logs_of, run_record

MOST_RUNS = 50
"""Runs of one answer."""
_MOST_LINES = 3
"""Lines of each run."""


@dataclass(frozen=True)
class FoundRun:
    """A run with the text in a log of its own."""

    run: str
    """Its configuration and number."""
    path: str
    """The log, relative to the results folder."""
    matches: int
    """Number of its lines with the text."""
    lines: list[LogLine]
    """The first ones."""


def search_logs(results: Path, campaign: str, runs: Sequence[str], text: str) -> list[FoundRun]:
    """Those of some runs of a campaign that have a text in a log, ignoring case.

    Args:
        results: the results folder, without links.
        campaign: name of the campaign.
        runs: configuration and number of each run, at most `MOST_RUNS`.
        text: what is searched for; of a log above 16 MiB, in its last part.
    """
    if not text.strip():
        return []
    found = (_search(results, campaign, run, text) for run in runs[:MOST_RUNS])
    return [run for run in found if run]


def _search(results: Path, campaign: str, run: str, text: str) -> FoundRun | None:
    place = f"{campaign}/{run}"
    record = run_record(results, place)
    try:
        paths, packed = logs_of(results, campaign, place, record)
        for path in paths:
            if not _has(results, path, text.casefold()):
                continue
            page = read_log(results, path, question_of_run(record, text, packed))
            if page.matches:
                return FoundRun(run, path, page.matches, page.lines[:_MOST_LINES])
    except InputError:  # gone meanwhile, or not to be read
        return None
    return None


def _has(results: Path, path: str, needle: str) -> bool:
    """Whether a text is in a log at all: that is said much faster than in which lines."""
    with open_inside(results, path) as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - PART))
        text = file.read(PART).decode("utf-8", "replace")
    return needle in (without_escapes(text) if "\x1b" in text else text).casefold()
