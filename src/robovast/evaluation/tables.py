"""Reads CSV files of a run, thinned out for drawing, whatever their size."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeVar

from robovast.analysis.tables.csv_files import csv_rows
from robovast.analysis.tables.spelling import number_in
from robovast.base.errors import InputError
from robovast.evaluation.confined_files import open_inside

MOST_ROWS = 2000
MOST_COLUMNS = 16
"""Number of columns that are read by default."""

_BY_INTEREST = (
    re.compile(r"time|timestamp|stamp|t"),
    re.compile(r"(.*position\.)?[xyz]"),
    re.compile(r"(.*[._])?(linear\.[xyz]|angular\.[xyz]|speed|velocity|v[xy]?)"),
)
"""Columns that are looked at first: times, then places, then speeds."""
_LAST = re.compile(r".*covariance.*|.*(header|stamp)\..*|.*seed")

Cell = float | str | None
_T = TypeVar("_T")


@dataclass(frozen=True)
class Table:
    """Columns of a CSV file."""

    names: list[str]
    """Names of all columns of the file."""
    columns: dict[str, list[Cell]]
    """The columns read: numbers if all cells are numbers or empty (None), otherwise text."""
    rows: int
    """Number of rows in the file."""
    stride: int
    """Interval between rows that were read."""


@dataclass(frozen=True)
class Usage:
    """CPU and memory usage of a container's processes over time."""

    time: list[float]
    """[s since the epoch]"""
    cpu: list[float]
    """[% of one CPU], all processes together"""
    memory: list[float]
    """Resident memory [bytes], all processes together; shared pages count more than once."""


def read_table(root: Path, relative: str, wanted: Sequence[str] = ()) -> Table:
    """A CSV file with a header, at most `MOST_ROWS` of its rows.

    Args:
        root: folder that the file is below, without links.
        relative: path of the file.
        wanted: names of columns; by default `MOST_COLUMNS`: times, places and speeds before others,
            covariances last.

    Raises:
        InputError: the file is missing or not a CSV file.
    """
    with closing(_rows(open_inside(root, relative), relative)) as rows:
        names = next(rows, [])
        places = [names.index(name) for name in wanted if name in names][:MOST_COLUMNS]
        places = places or by_interest(names)[:MOST_COLUMNS]
        kept, count, stride = _thinned([_cell(row, place) for place in places] for row in rows)
    columns = {names[place]: _typed([row[i] for row in kept]) for i, place in enumerate(places)}
    return Table(names, columns, count, stride)


def by_interest(names: Sequence[str]) -> list[int]:
    """Places of columns, those first that people look at first; equal ones stay in their order."""

    def rank(place: int) -> int:
        name = names[place].lower()
        if _LAST.fullmatch(name):
            return len(_BY_INTEREST) + 1
        matches = (i for i, pattern in enumerate(_BY_INTEREST) if pattern.fullmatch(name))
        return next(matches, len(_BY_INTEREST))

    return sorted(range(len(names)), key=rank)


def read_usage(root: Path, relative: str) -> Usage:
    """Resource usage as the run contract's monitor writes it, summed over the processes.

    Raises:
        InputError: the file is missing or has other columns.
    """
    totals: dict[float, tuple[float, float]] = {}
    with closing(_rows(open_inside(root, relative), relative)) as rows:
        names = next(rows, [])
        try:
            places = [names.index(n) for n in ("timestamp", "cpu_percent", "memory_rss_bytes")]
        except ValueError:
            raise InputError(f"{relative}: is not a record of resource usage.") from None
        for row in rows:
            time, cpu, memory = (_finite(_cell(row, place)) for place in places)
            if time is not None:
                total = totals.get(time, (0.0, 0.0))
                totals[time] = (total[0] + (cpu or 0), total[1] + (memory or 0))
    samples, _, _ = _thinned((time, *totals[time]) for time in sorted(totals))
    return Usage(*(list(column) for column in zip(*samples, strict=True))) if samples else _IDLE


_IDLE = Usage([], [], [])


def _rows(file: BinaryIO, relative: str) -> Generator[list[str], None, None]:
    started = False
    with file:
        try:
            for row in csv_rows(file):
                started = True
                yield [cell.replace("\0", "") for cell in row]
        except csv.Error as error:
            if not started:
                raise InputError(f"{relative}: is not a valid CSV file: {error}.") from None


def _thinned(rows: Iterable[_T]) -> tuple[list[_T], int, int]:
    """Every n-th row, with the smallest n for `MOST_ROWS`; number of rows; n."""
    kept: list[_T] = []
    stride, count = 1, 0
    for count, row in enumerate(rows, start=1):
        if (count - 1) % stride == 0:
            kept.append(row)
            if len(kept) > MOST_ROWS:
                kept = kept[::2]
                stride *= 2
    return kept, count, stride


def _cell(row: Sequence[str], place: int) -> str:
    return row[place] if place < len(row) else ""


def _typed(cells: Sequence[str]) -> list[Cell]:
    said = {cell for cell in cells if _has_value(cell)}
    numbers = {cell: number_in(cell, rounded=True) for cell in said}
    floats = {float(number) for number in numbers.values() if number is not None}
    if len(floats) < len(said):  # texts, or different cells that are one number
        return [cell[:200] for cell in cells]
    return [_finite(cell) for cell in cells]


def _has_value(cell: str) -> bool:
    return cell.strip().lower() not in {"", "nan", "inf", "-inf", "none", "null"}


def _finite(cell: str) -> float | None:
    try:
        number = float(cell)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
