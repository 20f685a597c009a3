"""The CSV files that a run holds, and their rows whatever state they are in."""

from __future__ import annotations

import csv
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import TextIO

from robovast.base.safe_paths import is_file, open_file

KEYS = ("config", "run")
"""Columns that say which run a row is of."""
LONGEST_LINE = 32 << 20
"""Characters; a file of zeros has one line of its size."""
_RESERVED = frozenset({"runs", "run_records", "loaded", "scenario_timestamps"})

csv.field_size_limit(sys.maxsize)


def csv_files(run: Path) -> dict[str, Path]:
    """The CSV files of a run by the name of their table: their path with `_` for what is no letter
    or digit. Links and what else is no regular file are none."""
    found: dict[str, Path] = {}
    for folder, folders, names in os.walk(run):
        folders.sort()
        for name in sorted(names):
            path = Path(folder, name)
            if name.endswith(".csv") and is_file(path, run):
                found.setdefault(table_name(path.relative_to(run).with_suffix("")), path)
    return found


def table_name(path: str | os.PathLike[str]) -> str:
    """The table of a CSV file, by its path without suffix."""
    name = re.sub(r"\W+", "_", os.fspath(path)).strip("_") or "table"
    name = f"t_{name}" if name[0].isdigit() or folded(name).startswith("sqlite_") else name
    return f"{name}_csv" if name.lower() in _RESERVED else name


def folded(name: str) -> str:
    """A name as databases compare it: letters of ASCII alone are the same in either case."""
    return "".join(letter.lower() if letter.isascii() else letter for letter in name)


def column_names(header: Sequence[str], keys: Iterable[str] = ("campaign", *KEYS)) -> list[str]:
    """Names of columns that differ, also from the keys, whatever case is used, and without NUL."""
    used = set(keys)
    names = []
    for index, cell in enumerate(header, 1):
        base = cell.replace("\0", "").strip().replace('"', "'") or f"column_{index}"
        name, count = base, 1
        while name.lower() in used:
            count += 1
            name = f"{base}_{count}"
        used.add(name.lower())
        names.append(name)
    return names


def read_header(path: Path) -> list[str]:
    """The first row; empty when the file is, or has none that can be read."""
    with _opened(path) as file, suppress(csv.Error):
        return next(iter(csv.reader(lines(file))), [])
    return []


def read_rows(path: Path, width: int) -> Iterator[list[str]]:
    """The rows below the header, each with as many cells as the header.

    Of a file that was cut off or is no UTF-8, what can be read is read.
    """
    with _opened(path) as file, suppress(csv.Error):
        rows = csv.reader(lines(file))
        next(rows, None)
        for row in rows:
            if row:
                yield row[:width] + [""] * (width - len(row))


def lines(file: TextIO) -> Iterator[str]:
    """The lines of a CSV file, each held in memory.

    Raises:
        csv.Error: one is longer than `LONGEST_LINE`.
    """
    while line := file.readline(LONGEST_LINE + 1):
        if len(line) > LONGEST_LINE:
            raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
        yield line


def _opened(path: Path) -> TextIO:
    return TextIOWrapper(open_file(path), encoding="utf-8-sig", errors="replace", newline="")
