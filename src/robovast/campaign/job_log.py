"""The log of a job, and which part of it is about one of its runs. Pure functions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from robovast.campaign.layout import LOGS, SYSTEM_LOG

OWN = "[robovast] "
"""Begins the lines of the run contract's own scripts."""
RUN = f"{OWN}run "
"""A run of a pack begins; its folder follows."""
_EXECUTES = "Executing scenario "
"""In what scenario-execution says when a run begins."""
_ENDS = (RUN, f"{OWN}job ", f"{OWN}ended with code ")
_END = re.compile("|".join(f"^{re.escape(end)}" for end in _ENDS).encode(), re.MULTILINE)


def log_path(secondary: str | None) -> str:
    """The log of a job's main container, or of a secondary one, in the job's folder."""
    return SYSTEM_LOG if secondary is None else f"{LOGS}/system_{secondary}.log"


def has_parts(lines: Iterable[str]) -> bool | None:
    """Whether the log of a pack tells its runs apart; None while none has begun."""
    for line in lines:
        if line.startswith(RUN):
            return True
        if _EXECUTES in line:
            return False
    return None


def own_part(log: bytes, run: str) -> slice:
    """Where the lines about one run are in a part of a pack's log; all where it names no run.

    Args:
        log: that part, which has none about runs before it if it lacks the beginning of this one.
        run: `<variant>/<number>`.
    """
    if RUN.encode() not in log:
        return slice(0, len(log))
    begun = re.search(rf"^{re.escape(RUN + run)}$\n?".encode(), log, re.MULTILINE)
    begin = begun.end() if begun else 0
    end = _END.search(log, begin)
    return slice(begin, end.start() if end else len(log))


def part_of(lines: Iterable[str], run: str) -> Iterator[str]:
    """The lines of a pack's log that are about one run; none when the log does not tell runs apart.

    It ends as soon as the next run begins, or the job has ended: the lines may be those of a log
    that grows.

    Args:
        lines: of the log.
        run: `<variant>/<number>`.
    """
    inside = False
    for line in lines:
        if inside and line.startswith(_ENDS):
            return
        inside = inside or line == RUN + run
        if inside:
            yield line
