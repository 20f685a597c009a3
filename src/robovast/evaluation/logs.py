"""Finds logs of a run and reads them by page, whatever their size."""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from robovast.campaign.log_lines import BAD, LEVELS, parse_line, without_escapes
from robovast.campaign.reasons import says_error
from robovast.evaluation.confined_files import open_inside
from robovast.evaluation.summaries import seconds

PAGE = 2000
"""Lines per page."""
LONGEST_LINE = 4000
"""Characters kept per line."""
PART = 16 << 20
"""Part of a larger log that is read for one answer [bytes]."""
_PROBE = 1 << 16
"""Block that is read at each step when a time is searched in a large log [bytes]."""

_STAMP = re.compile(r"\[(\d{9,10}\.\d{3,9})\]")
_STAMP_BYTES = re.compile(_STAMP.pattern.encode())


class LogLine(NamedTuple):
    """One line; `level` is empty if unknown."""

    number: int
    level: str
    text: str


@dataclass(frozen=True)
class LogPage:
    """The last lines that match a question.

    They are from the whole file or, if it is larger than `PART`, from a part of it.
    """

    lines: list[LogLine]
    """Numbered from the beginning of the part."""
    matches: int
    """Number of matching lines."""
    total: int
    """All lines."""
    counts: dict[str, int]
    """Number of lines of each level."""
    error: int | None
    """Number of the first error, of any line of the part or the period; None without one."""
    begin: int
    """Start of the part [bytes]; 0 if the whole file was read."""
    end: int
    """End of the part [bytes]."""
    size: int
    """Size of the file [bytes]."""


@dataclass(frozen=True)
class LogQuestion:
    """Selects lines of a log."""

    text: str = ""
    """Only lines with this text, ignoring case."""
    levels: frozenset[str] = frozenset()
    """Only lines of these levels; empty means all."""
    since: float | None = None
    """Only lines stamped in this period [s since the epoch]; others join the line before."""
    until: float | None = None
    before: int | None = None
    """Only lines before this number: the page that precedes another."""
    end: int | None = None
    """Of a large file the part that ends here [bytes]: the one that precedes another."""


def question_of_run(record: Mapping[str, Any], text: str, packed: bool) -> LogQuestion:
    """Ask a run's log for a text; if the log is of several runs, only for the lines of this one:
    from a little before it begins to a little after it ends."""
    begin, end = (seconds(record.get(key)) for key in ("started_at", "finished_at"))
    if not packed or begin is None or end is None:
        return LogQuestion(text)
    return LogQuestion(text, since=begin - 0.002, until=end + 0.02)


def read_log(root: Path, relative: str, question: LogQuestion) -> LogPage:
    """The last page of the lines that match; of a large file, of those in its last part, or in the
    one that ends with the period.

    Raises:
        InputError: there is no such file below `root`.
    """
    needle = question.text.casefold()
    page: deque[LogLine] = deque(maxlen=PAGE)
    counts = dict.fromkeys(LEVELS, 0)
    matches = total = 0
    errors = _Errors()
    with open_inside(root, relative) as file:
        size = os.fstat(file.fileno()).st_size
        begin, end = _part(file, size, question)
        for line in _in_period(parse_lines(_lines(file, begin, end)), question):
            total += 1
            if line.level:
                counts[line.level] += 1
            errors.see(line)
            if question.levels and line.level not in question.levels:
                continue
            if needle and needle not in line.text.casefold():
                continue
            matches += 1
            if question.before is None or line.number < question.before:
                page.append(line)
    return LogPage(list(page), matches, total, counts, errors.first, begin, end, size)


class _Errors:
    """The first error; what the executor passed as an error without being one comes second."""

    def __init__(self) -> None:
        self._said: int | None = None
        self._passed: int | None = None

    @property
    def first(self) -> int | None:
        return self._said or self._passed

    def see(self, line: LogLine) -> None:
        if self._said or line.level not in BAD:
            return
        if says_error(line.text):
            self._said = line.number
        self._passed = self._passed or line.number


def _part(file: BinaryIO, size: int, question: LogQuestion) -> tuple[int, int]:
    end = size
    if size > PART and question.end is not None:
        end = max(0, min(question.end, size))
    elif size > PART and question.until is not None:
        end = _place_after(file, size, question.until)
    return max(0, end - PART), end


def _place_after(file: BinaryIO, size: int, moment: float) -> int:
    """A place behind all lines that are stamped up to a moment: stamps grow on the whole."""
    low, high = 0, size
    while high - low > _PROBE:
        middle = (low + high) // 2
        file.seek(middle)
        stamp = _STAMP_BYTES.search(file.read(_PROBE))
        if stamp and float(stamp[1]) <= moment:
            low = middle
        else:
            high = middle
    return min(size, high + _PROBE)


def parse_lines(lines: Iterable[str]) -> Iterator[LogLine]:
    """Lines with their levels; what follows a line and is indented shares its level."""
    level = ""
    for number, raw in enumerate(lines, start=1):
        text = without_escapes(raw)
        said = parse_line(text).level
        if said:
            level = said
        elif text.startswith("Traceback "):
            level = "error"
        elif not text.startswith((" ", "\t")):
            level = "error" if _ends_traceback(level, text) else ""
        yield LogLine(number, level, text)


def _ends_traceback(level: str, text: str) -> bool:
    return level == "error" and bool(re.match(r"[\w.]+(Error|Exception)\b", text))


def _lines(file: BinaryIO, begin: int, end: int) -> Iterator[str]:
    """Lines that begin in a part of a file; what is too long for a line is passed over, not held
    in memory."""
    file.seek(begin)
    goes_on = begin > 0  # a line that begins before is of the part before
    while begin < end and (raw := file.readline(4 * LONGEST_LINE)):
        begin += len(raw)
        if not goes_on:
            yield raw.decode("utf-8", "replace").rstrip("\r\n")[:LONGEST_LINE]
        goes_on = not raw.endswith(b"\n")


def _in_period(lines: Iterable[LogLine], question: LogQuestion) -> Iterator[LogLine]:
    if question.since is None or question.until is None:
        yield from lines
        return
    inside = False
    for line in lines:
        stamp = _STAMP.search(line.text[:200])
        if stamp:
            inside = question.since <= float(stamp[1]) <= question.until
        if inside:
            yield line
