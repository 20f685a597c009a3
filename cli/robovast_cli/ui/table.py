"""Format text in columns."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from textwrap import wrap

from robovast.base.printable import one_line

WIDEST_CELL = 40
WIDEST_REASON = 60
"""Maximum length of a reason."""
NARROWEST = 6
"""Minimum width of a column on a terminal [characters]."""
MOST_LINES = 8
"""Maximum number of lines of a cell."""
_GAP = "  "


def format_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return text in columns that fit their widest cell, and also the terminal."""
    lines = [[one_line(cell) for cell in row] for row in (columns, *rows)]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    if sys.stdout.isatty():
        widths = fitting(widths, shutil.get_terminal_size().columns)
    return "".join(_row(line, widths) for line in lines)


def _row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a row with as many lines as its longest cell needs; words are not broken."""
    columns = [_lines(cell, width) for cell, width in zip(cells, widths, strict=True)]
    padded = (
        (f"{text:<{width}}" for text, width in zip(line, widths, strict=True))
        for line in zip_longest(*columns, fillvalue="")
    )
    return "".join(f"{_GAP.join(line).rstrip()}\n" for line in padded)


def _lines(cell: str, width: int) -> list[str]:
    if len(cell) <= width:
        return [cell]
    if cell[0] in "[{":  # data is cut, prose is not
        return [shortened(cell, width)]
    lines = wrap(cell, width, break_long_words=False, break_on_hyphens=False)
    more = [f"{lines[MOST_LINES - 1]} …"] if len(lines) > MOST_LINES else lines[MOST_LINES - 1 :]
    return [shortened(line, width) for line in [*lines[: MOST_LINES - 1], *more]]


def shortened(text: str, width: int) -> str:
    """Return a text of at most `width` characters; `…` replaces its end."""
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"


def fitting(widths: Sequence[int], width: int) -> list[int]:
    """Return widths of columns that fit into a width: reduce the widest first, the first one last.

    Columns that still do not fit keep `NARROWEST` characters.
    """
    found = list(widths)
    room = width - len(_GAP) * (len(found) - 1)
    for columns in (found[1:], found):
        excess = sum(found) - room
        if excess <= 0:
            break
        offset = len(found) - len(columns)
        found[offset:] = _narrower(columns, sum(columns) - excess)
    return found


def _narrower(widths: Sequence[int], room: int) -> list[int]:
    """Return widths that fit into the room, the largest reduced to a common limit."""
    limit = next(
        (
            limit
            for limit in range(max(widths, default=0), NARROWEST, -1)
            if sum(min(width, limit) for width in widths) <= room
        ),
        NARROWEST,
    )
    return [min(width, limit) for width in widths]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural with `s` unless the number is 1."""
    return f"1 {noun}" if number == 1 else f"{number} {noun}s"
