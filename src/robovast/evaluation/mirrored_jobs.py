"""Jobs that a cluster executes, as far as the mirror of their bucket tells."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from robovast.base.ranges import parse_ranges
from robovast.campaign.layout import JOBS, SYSTEM_LOG, parameters_key
from robovast.campaign.object_keys import ORIGIN
from robovast.evaluation.summaries import ActiveJob, VariantRuns

RECENT = 150.0
"""How old the newest file of such a job may be [s]: while a job runs, its changed files are stored
every half minute, large ones more rarely (`SNAPSHOT_INTERVAL` and `PACE` of
robovast.agent.results), and the mirror looks once a minute."""

_JOB = re.compile(r"job-(\d{1,9})(?:-(\d{1,9}))?")
_CLAIM = re.compile(r"# attempt \d+, runs ([\d,-]+), executed by ")
_LONGEST_CLAIM = 1 << 20
"""How much of a job's parameters is read to find its claim [byte]."""


def mirrored_jobs(
    results: Path, campaign: str, variants: Iterable[VariantRuns], now: float
) -> tuple[ActiveJob, ...] | None:
    """The jobs of a mirrored campaign that go on, in order; None if none does.

    Args:
        results: the results folder.
        campaign: the campaign's folder in it.
        variants: its stored runs.
        now: the time [s since the epoch].
    """
    root = results / campaign
    if not os.path.isfile(root / ORIGIN):
        return None
    recent = sorted(_recent(root, now))
    stored = Counter(run.job for one in variants for run in one.runs) if recent else Counter()
    going = [name for _, name in recent if stored[name] < _claimed(root, name)]
    return tuple(ActiveJob(n, f"{campaign}/{JOBS}/{n}/{SYSTEM_LOG}") for n in going) or None


def _recent(root: Path, now: float) -> Iterator[tuple[tuple[int, int], str]]:
    """Place in order, and name, of jobs with a log of which a file was stored not long ago."""
    for name in _names(root / JOBS):
        found, folder = _JOB.fullmatch(name), root / JOBS / name
        try:
            stored = (folder / SYSTEM_LOG).stat(follow_symlinks=False).st_mtime
            with os.scandir(folder) as others:
                times = [
                    entry.stat(follow_symlinks=False).st_mtime
                    for entry in others
                    if entry.is_file(follow_symlinks=False)
                ]
        except OSError:  # it has none yet
            continue
        if found and now - max(stored, *times, 0.0) < RECENT:
            yield (int(found[1]), int(found[2] or 1)), name


def _names(folder: Path) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:  # no job has stored anything yet
        return []


def _claimed(root: Path, job: str) -> int:
    """How many runs a job executes, as its first line says; one if that cannot be read."""
    try:
        with (root / parameters_key(job)).open(encoding="utf-8", errors="replace") as file:
            found = _CLAIM.match(file.readline(_LONGEST_CLAIM))
        return sum(last - first + 1 for first, last in parse_ranges(found[1])) if found else 1
    except (OSError, ValueError):
        return 1
