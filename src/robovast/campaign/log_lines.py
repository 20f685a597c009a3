"""Lines of logs: their level, their text without prefixes, and when they were written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

LEVELS = ("debug", "info", "warn", "error", "fatal")
BAD = frozenset({"error", "fatal"})

_WORD = r"(DEBUG|INFO|WARN(?:ING)?|ERR(?:OR)?|FATAL|CRITICAL)"
_NAMES = {"warning": "warn", "critical": "fatal", "err": "error"}
_PREFIX = re.compile(
    rf"\s*\[\s*{_WORD}\s*\]"
    r"(?:\s*\[(\d{1,10}\.\d{1,9})\])?(?:\s*\[([^\]]{0,100})\])?:?\s*",
    re.IGNORECASE,
)
"""Prefix of ROS and scenario-execution."""
_LAUNCHED = re.compile(r"^\s*\[[\w./-]+-\d+\]:?\s+")
"""Prefix of a process that `ros2 launch` started."""
_ELSEWHERE = re.compile(rf"\[\s*{_WORD}\s*\]|\b{_WORD}\b\s*[:|]", re.IGNORECASE)
"""A level anywhere else in a line's beginning."""
_AT_START = re.compile(rf"(?:[\d\s.,:TZ+-]*){_WORD}\b\s*[:|]\s*", re.IGNORECASE)
_SEARCHED = 200
"""Characters in which a level is searched."""
_DEEPEST = 4
"""Most prefixes in front of one text."""
_ESCAPES = re.compile(
    r"\x1b\[[0-9;?]*[ -/]*[@-~]|\x1b\][^\x07\x1b\n]*(?:\x07|\x1b\\)|[\x00-\x08\x0b-\x1f\x7f]"
)
"""A sequence ends in its line and before the next one: if each were searched to the end of a text,
time would grow with the square of its length."""


class LogMessage(NamedTuple):
    """What one line says."""

    text: str
    """The text without prefixes."""
    levels: Sequence[str]
    """Levels of its prefixes, the outermost first; a program's output has the level of the program
    that logged it in front of its own."""
    source: str
    """Name in the outermost prefix, of a node or logger; empty if unknown."""
    stamp: float | None
    """Time in the outermost prefix [s]."""

    @property
    def level(self) -> str:
        """The innermost level; empty if there is none."""
        return self.levels[-1] if self.levels else ""


def without_escapes(text: str) -> str:
    """A line without terminal sequences and control characters."""
    return text if text.isprintable() else _ESCAPES.sub("", text)


def parse_line(line: str) -> LogMessage:
    """Separate a line's text from its prefixes."""
    text = without_escapes(line)
    levels: list[str] = []
    source, stamp = "", None
    for _ in range(_DEEPEST):
        text = _LAUNCHED.sub("", text, count=1)
        found = _PREFIX.match(text)
        if found is None:
            break
        levels.append(_level(found[1]))
        source = found[3] or "" if len(levels) == 1 else source
        stamp = float(found[2]) if found[2] and stamp is None else stamp
        text = text[found.end() :]
    begin = text[:_SEARCHED]
    found = _AT_START.match(begin) if levels else _ELSEWHERE.search(begin)
    if found:
        levels.append(_level(next(filter(None, found.groups()))))
        at_start = _AT_START.match(begin)
        text = text[at_start.end() :] if at_start else text
    return LogMessage(text.strip(), levels, source, stamp)


def _level(word: str) -> str:
    name = word.lower()
    return _NAMES.get(name, name)
