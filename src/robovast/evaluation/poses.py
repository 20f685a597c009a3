"""Where robots drove, as the tables of poses of their runs tell it."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from robovast.base.errors import InputError
from robovast.evaluation.confined_files import open_inside
from robovast.evaluation.tables import Cell, Table, read_table

POSES = "poses.csv"
"""Table of a robot's poses in the folder of a run."""
LAST_SECONDS = 5.0
"""What counts as the last of a drive [s]."""
_END = 4096
"""Last bytes of a table that are read, and most of its head."""
_ROW = 1024
"""What is read to find one row in a large table [bytes]."""

Place = tuple[float, float]
"""x and y [m]"""


@dataclass(frozen=True)
class Way:
    """Where a robot drove."""

    episodes: list[list[Place]]
    """[m]; a simulation reset, after which time jumps back, begins an episode."""
    last: int
    """Index of the first place of the last seconds in the last episode."""


def last_position(results: Path, run: str) -> Place | None:
    """Where a run ended [m]; None if that is not in its table of poses."""
    return next(iter(rough_way(results, run, 1)), None)


def rough_way(results: Path, run: str, count: int) -> list[Place]:
    """At most so many places of a run's last episode, its last place included; empty if unknown.

    Of a large table only a part is read, so that many runs can be shown at once.
    """
    try:
        with open_inside(results, f"{run}/{POSES}") as file:
            head = file.readline(_END).decode("utf-8", "replace")
            lines = _some_rows(file, count)
        table = list(csv.DictReader([head, *lines]))
        rows = [row for row in table if row.get("frame") == table[-1].get("frame")]
        places = [(_time(row), place) for row in rows if (place := _place(row))]
    except (InputError, csv.Error):
        return []
    return [place for _, place in _episodes(places)[-1]] if places and _place(rows[-1]) else []


def _episodes(rows: Iterable[tuple[float, Place]]) -> list[list[tuple[float, Place]]]:
    """Times and places, divided where time jumps back."""
    found: list[list[tuple[float, Place]]] = []
    for row in rows:
        if not found or row[0] < found[-1][-1][0]:
            found.append([])
        found[-1].append(row)
    return found


def _time(row: Mapping[str, str | None]) -> float:
    """The time in a row of a table of poses [s]; NaN if it is invalid or missing."""
    try:
        return float(row["timestamp"] or "nan")
    except (KeyError, ValueError):
        return math.nan


def _some_rows(file: BinaryIO, count: int) -> list[str]:
    """At most so many rows of a table, from where its file is read: evenly spaced, the last too."""
    begin, end = file.tell(), os.fstat(file.fileno()).st_size
    if count > 1 and end - begin <= count * _ROW:
        rows = file.read(end - begin).splitlines()
        step = max(1.0, (len(rows) - 1) / (count - 1))
        rows = [rows[-1 - round(i * step)] for i in range(min(count, len(rows)))][::-1]
    else:
        starts = (begin + (end - begin) * i // count for i in range(1, count))
        parts = (os.pread(file.fileno(), _ROW, start).split(b"\n", 2) for start in starts)
        tail = os.pread(file.fileno(), _END, max(begin, end - _END))
        rows = [part[1] for part in parts if len(part) > 2] + tail.splitlines()[-1:]
    return [row.decode("utf-8", "replace") for row in rows]


def _place(row: Mapping[str, str | None]) -> Place | None:
    """The place in a row of a table of poses; None if it is invalid or a column is missing."""
    try:
        x, y = float(row["position.x"] or ""), float(row["position.y"] or "")
    except (KeyError, ValueError):
        return None
    whole = None not in row.values() and math.isfinite(x) and math.isfinite(y)
    return (round(x, 3), round(y, 3)) if whole else None


def way(results: Path, run: str) -> Way | None:
    """The way of a run according to its table of poses; None without one.

    Args:
        results: the results folder, without links.
        run: its folder, relative to that.
    """
    wanted = ("frame", "timestamp", "position.x", "position.y")
    try:
        table = read_table(results, f"{run}/{POSES}", wanted)
    except InputError:
        return None
    episodes = _episodes((time, (x, y)) for time, x, y in _rows_of_one_frame(table))
    if not episodes:
        return None
    since = episodes[-1][-1][0] - LAST_SECONDS
    last = sum(time < since for time, _ in episodes[-1])
    return Way([[place for _, place in episode] for episode in episodes], last)


def _rows_of_one_frame(table: Table) -> list[tuple[float, float, float]]:
    """Times and places of the frame in the last row: that of the robot, as for its end."""
    columns = [table.columns.get(name) for name in ("timestamp", "position.x", "position.y")]
    if None in columns:
        return []
    frames: Sequence[Cell] = table.columns.get("frame") or [""] * len(columns[0] or ())
    rows = zip(frames, *filter(None, columns), strict=True)
    return [
        (row[0], row[1], row[2])
        for frame, *row in rows
        if frame == frames[-1] and _are_numbers(row)
    ]


def _are_numbers(row: Sequence[Cell]) -> bool:
    return all(isinstance(value, float) for value in row)
