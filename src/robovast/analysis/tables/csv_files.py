"""Finds the CSV files of a run and reads their rows, even from damaged files.

| supported | rule |
| --- | --- |
| cells separated by commas | a header that is a single cell with `;`, tab or `|` is refused |
| quotes | `"`, doubled inside a quoted cell, which may have line breaks |
| UTF-8, with or without byte order mark | invalid bytes are read as U+FFFD, with a message |
| UTF-16, UTF-32 with byte order mark | without the mark they are refused |
| comments | lines that begin with `#` and have fewer cells than the header; above the header also others, except a header that begins with `#`: directly above a row of as many cells, at least one of them a number; the `#` is removed |
| a first line `sep=,`, which Excel reads | it is left out; files with another character are refused |
| rows with fewer cells than the header | the missing cells are empty |
| rows with more cells | the additional cells are left out, with a message |
| columns | at most 5,000 |
| header cells that are equal or empty | their columns get numbers |

Lines end with LF or CRLF.
"""  # noqa: E501  # a table

from __future__ import annotations

import codecs
import csv
import logging
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from io import TextIOWrapper
from itertools import chain
from pathlib import Path
from typing import BinaryIO, TextIO

from robovast.base.safe_paths import is_file, open_file

KEYS = ("config", "run")
"""Columns that identify the run of a row."""
MOST_COLUMNS = 5_000
"""Most columns of a file; DuckDB takes time with the square of their number, minutes for these."""
LONGEST_LINE = 32 << 20
"""Longest line [characters]; a file of zeros is a single line."""
_RESERVED = frozenset({"runs", "run_records", "loaded", "scenario_timestamps"})

_CHUNK = 1 << 20
"""Bytes of a file that are examined at once."""
_SPACED_QUOTE = re.compile(rb'[,\n][ \t]+"|"[ \t]+[,\r\n]')

_SEPARATOR = re.compile(r"sep=(.)")
_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # before UTF-16, whose mark it begins with
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_DELIMITERS = {";": "`;`", "\t": "tabs", "|": "`|`"}
_END = "\0end of the file\0"
"""A last line, which shows whether a quoted cell is still open."""
LOGGER = logging.getLogger(__name__)

csv.field_size_limit(sys.maxsize)


def csv_files(run: Path) -> dict[str, Path]:
    """The CSV files of a run by table name: the path with `_` for anything but letters and digits.
    Only regular files count. Of several files with one name, the first one counts, which is logged;
    databases ignore the case of names."""
    found: dict[str, tuple[str, Path]] = {}
    for folder, folders, names in os.walk(run):
        folders.sort()
        for name in sorted(names):
            path = Path(folder, name)
            if name.lower().endswith(".csv") and is_file(path, run):
                table = table_name(path.relative_to(run).with_suffix(""))
                _, first = found.setdefault(folded(table), (table, path))
                if first != path:
                    _warn(f"{path} is not read: {first} is the table `{table}`; rename one of them")
    return dict(found.values())


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
    """The header; empty if the file is empty, or not a supported CSV file, which is logged."""
    try:
        with open_file(path) as file:
            return next(csv_rows(file), [])
    except csv.Error as error:
        _warn(f"{path} is not read: {error}")
        return []


def read_rows(path: Path, width: int) -> Iterator[list[str]]:
    """The rows below the header, each with as many cells as the header.

    A damaged file is read as far as possible; what is lost is logged.
    """
    try:
        with open_file(path) as file:
            rows = csv_rows(file)
            next(rows, None)
            for row in rows:
                if any(row[width:]):
                    _warn(
                        f"{path} has rows with more cells than the header; the cells without a "
                        "column are skipped"
                    )
                if any("\ufffd" in cell for cell in row):
                    _warn(f"{path} has bytes that are not valid text; they are read as �")
                yield row[:width] + [""] * (width - len(row))
    except csv.Error as error:
        _warn(f"{path} is not read to its end: {error}")


@lru_cache(maxsize=1000)  # each message once, although several databases are made
def _warn(message: str) -> None:
    LOGGER.warning(message)


def is_plain(path: Path) -> bool:
    """Whether DuckDB reads the rows of a file as `csv_rows` does.

    It does not if the header has a mark, a comment or a line break, or the file has blank lines,
    other line ends than the header, or spaces next to the quotes of a cell.
    """
    with open_file(path) as file:
        header = file.readline(_CHUNK)
        end = b"\r\n" if header.endswith(b"\r\n") else b"\n"
        others = (b"#", b"sep=", codecs.BOM_UTF8, *_MARKS)
        if header.startswith(others) or header.count(b'"') % 2:
            return False
        file.seek(0)
        last = end
        while chunk := file.read(_CHUNK):
            chunk += file.readline(_CHUNK)  # line ends are not divided
            if not _is_plain(last[-2:] + chunk, end):
                return False
            last = chunk
    return True


def _is_plain(text: bytes, end: bytes) -> bool:
    breaks = text.count(b"\n")
    return not (
        b"\n" + end in text
        or b"\0" in text
        or text.count(b"\r") != (breaks if end == b"\r\n" else 0)
        or text.count(end) != breaks
        or (b'"' in text and _SPACED_QUOTE.search(text))
    )


def csv_rows(file: BinaryIO) -> Iterator[list[str]]:
    """The header and the rows of a CSV file, without empty rows and comments.

    Args:
        file: the file, at its beginning; it is closed at the end.

    Raises:
        csv.Error: the file is not a supported CSV file; see the module.
    """
    with TextIOWrapper(file, _encoding(file), errors="replace", newline="") as text:
        yield from _rows(lines(text))


def _rows(found: Iterator[str]) -> Iterator[list[str]]:
    header: list[str] = []
    for row in filter(None, csv.reader(chain(_from_header(found), [_END]))):
        is_last = row[-1].endswith(_END)
        row[-1] = row[-1].removesuffix(_END)
        if is_last and row == [""]:
            return
        if not header:
            header = row
            _check_delimiter(header)
            if len(header) > MOST_COLUMNS:
                raise csv.Error(
                    f"it has {len(header):,} columns; at most {MOST_COLUMNS:,} are read"
                )
        if len(row) >= len(header) or not row[0].startswith("#"):
            yield row
        if is_last:
            raise csv.Error("a quoted cell is not closed")


def _check_delimiter(header: Sequence[str]) -> None:
    for sign, name in _DELIMITERS.items():
        if len(header) == 1 and sign in header[0]:
            raise csv.Error(f"its cells are separated by {name}; separate them by commas")


def _encoding(file: BinaryIO) -> str:
    head = file.read(4)
    file.seek(0)
    for mark, encoding in _MARKS.items():
        if head.startswith(mark):
            return encoding
    if len(head) > 1 and head.count(0) == len(head) // 2 and bool(head[0]) != bool(head[1]):
        raise csv.Error("it is UTF-16 without a byte order mark; write UTF-8")
    return "utf-8-sig"


def _from_header(found: Iterator[str]) -> Iterator[str]:
    """The lines without comments and blank lines above the header."""
    comment = ""
    for line in _without_separator(found):
        if not line.startswith(("#", "\r", "\n")):
            if comment and _is_header(comment, line):
                yield _uncommented(comment)
            yield line
            break
        comment = line.strip("\r\n") and line
    else:
        yield _uncommented(comment)
    yield from found


def _without_separator(found: Iterator[str]) -> Iterator[str]:
    first = next(found, "")
    sign = _SEPARATOR.fullmatch(first.rstrip("\r\n"))
    if sign and sign[1] != ",":
        raise csv.Error(f"its cells are separated by `{sign[1]}`; separate them by commas")
    return found if sign else chain([first] if first else [], found)


def _is_header(comment: str, row: str) -> bool:
    cells = next(csv.reader([row]), [])
    same = len(cells) == len(next(csv.reader([_uncommented(comment)]), []))
    return same and any(map(_is_number, cells))


def _uncommented(comment: str) -> str:
    return comment.removeprefix("#").lstrip()


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def lines(file: TextIO) -> Iterator[str]:
    """The lines of a CSV file.

    Raises:
        csv.Error: a line is longer than `LONGEST_LINE`.
    """
    while line := file.readline(LONGEST_LINE + 1):
        if len(line) > LONGEST_LINE:
            raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
        yield line
