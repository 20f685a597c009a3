"""Markdown as GitHub and GitLab have it, of texts that nobody vouches for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

from robovast.base.printable import one_line, printable

_SIGNS = re.compile(r"[\\`|\[\]_*~@#:!$]|(?<=www)\.", re.IGNORECASE)
_FENCE = re.compile(r"`{3,}")


def escaped(text: str) -> str:
    """A text in one line that is no markup, link or mention, in a table too."""
    return _SIGNS.sub(lambda found: f"&#{ord(found[0])};", escape(one_line(text)))


def code(text: str) -> str:
    """A name or a reason; nobody is notified of what it mentions."""
    return f"<code>{escaped(text)}</code>" if text else ""


def code_block(lines: Iterable[str], language: str = "") -> list[str]:
    """Lines of a log or a file, as they are."""
    text = printable("\n".join(lines))
    fence = "`" * max([3, *(len(found) + 1 for found in _FENCE.findall(text))])
    return [f"{fence}{language}", text, fence]


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table of plain texts."""
    return table_of_markup(columns, ([escaped(cell) for cell in row] for row in rows))


def table_of_markup(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table whose cells are Markdown already."""
    lines = ([escaped(name) for name in columns], ["---"] * len(columns), *rows)
    return [f"| {' | '.join(line)} |" for line in lines]
