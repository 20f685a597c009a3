"""Finds the CSV files of a run and reads their rows, even from damaged files."""

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
"""Columns that identify the run of a row."""
LONGEST_LINE = 32 << 20
"""Longest line [characters]; a file of zeros is a single line."""
_RESERVED = frozenset({"runs", "run_records", "loaded", "scenario_timestamps"})

csv.field_size_limit(sys.maxsize)


def csv_files(run: Path) -> dict[str, Path]:
    """The CSV files of a run by table name: the path with `_` for anything but letters and digits.
    Only regular files count."""
    found: dict[str, Path] = {}
    for folder, folders, names in os.walk(run):
        folders.sort()
        for name in sorted(names):
            path = Path(folder, name)
            if name.endswith(".csv") and is_file(path, run):
                found.setdefault(table_name(path.relative_to(run).with_suffix("")), path)
    return found


def table_name(path: str | os.PathLike[str]) -> str:
    """Table name of a CSV file, from its path without suffix."""
    name = re.sub(r"\W+", "_", os.fspath(path)).strip("_") or "table"
    name = f"t_{name}" if name[0].isdigit() or folded(name).startswith("sqlite_") else name
    return f"{name}_csv" if name.lower() in _RESERVED else name


def folded(name: str) -> str:
    """A name for comparison as in databases, which ignore the case of ASCII letters."""
    return "".join(letter.lower() if letter.isascii() else letter for letter in name)


def column_names(header: Sequence[str], keys: Iterable[str] = ("campaign", *KEYS)) -> list[str]:
    """Unique column names, regardless of case, that differ from the keys and contain no NUL."""
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
    """The first row; empty if the file is empty or unreadable."""
    with _opened(path) as file, suppress(csv.Error):
        return next(iter(csv.reader(lines(file))), [])
    return []


def read_rows(path: Path, width: int) -> Iterator[list[str]]:
    """The rows below the header, each with as many cells as the header.

    Truncated files and invalid UTF-8 are read as far as possible.
    """
    with _opened(path) as file, suppress(csv.Error):
        rows = csv.reader(lines(file))
        next(rows, None)
        for row in rows:
            if row:
                yield row[:width] + [""] * (width - len(row))


def lines(file: TextIO) -> Iterator[str]:
    """The lines of a CSV file.

    Raises:
        csv.Error: a line is longer than `LONGEST_LINE`.
    """
    while line := file.readline(LONGEST_LINE + 1):
        if len(line) > LONGEST_LINE:
            raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
        yield line


def _opened(path: Path) -> TextIO:
    return TextIOWrapper(open_file(path), encoding="utf-8-sig", errors="replace", newline="")
