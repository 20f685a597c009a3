"""Configurations as a table, names, JSON or YAML; equal documents give equal bytes."""

from __future__ import annotations

import contextlib
import gc
import json
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from textwrap import wrap
from typing import Any, Literal

from robovast.base.printable import one_line, printable_json
from robovast.base.serialization import dump_yaml
from robovast.campaign.configurations import configuration_record
from robovast.model.document import Document
from robovast.model.document.model import Execution
from robovast.model.expansion import Variant
from robovast_cli.ui.expanding import expanded

Format = Literal["table", "name", "json", "yaml"]

WIDEST_CELL = 40
NARROWEST = 6
"""Least width to which a column is cut on a terminal [characters]."""
MOST_LINES = 8
"""Most lines of one cell."""
_GAP = "  "

_to_json = json.JSONEncoder(ensure_ascii=False, default=str).encode


def print_configurations(document: Document, output: Format, *, internal: bool) -> None:
    """Print what a document expands to.

    Args:
        document: a checked document.
        output: how.
        internal: also show keys that begin with `_`.
    """
    with no_garbage_collection(), expanded(document) as variants:
        text = _FORMATS[output](variants, internal)
    if output == "table":
        text += f"\n{_count(document, variants)}\n"
    sys.stdout.write(text)


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Collect no garbage meanwhile.

    The many objects of a list live to its end; looking among them for garbage again and again
    would make the time grow faster than their number.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def record(variant: Variant, *, internal: bool) -> dict[str, Any]:
    """A configuration as plain data."""
    if internal:
        return configuration_record(variant, timings=False)
    return {"name": variant.name, "config": _public(variant.parameters), **_public(variant.extra)}


def _public(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if not name.startswith("_")}


def _names(variants: Sequence[Variant], internal: bool) -> str:
    del internal
    return "".join(f"{variant.name}\n" for variant in variants)


def _json(variants: Sequence[Variant], internal: bool) -> str:
    lines = (_to_json(record(variant, internal=internal)) for variant in variants)
    return printable_json("[\n" + ",\n".join(lines) + "\n]\n")


def _yaml(variants: Sequence[Variant], internal: bool) -> str:
    return dump_yaml([record(variant, internal=internal) for variant in variants])


def _table(variants: Sequence[Variant], internal: bool) -> str:
    """One row a configuration, one column a parameter."""
    rows = [_cells(variant, internal) for variant in variants]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    lines = (
        [variant.name, *(row.get(key, "") for key in columns)]
        for variant, row in zip(variants, rows, strict=True)
    )
    return format_table(["NAME", *columns], lines)


def _cells(variant: Variant, internal: bool) -> dict[str, str]:
    whole = record(variant, internal=internal)
    parameters = whole.pop("config")
    del whole["name"]
    return {key: _cell(value) for key, value in {**whole, **parameters}.items()}


def _cell(value: Any) -> str:
    return shortened(value if isinstance(value, str) else _to_json(value), WIDEST_CELL)


def format_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Text in columns as wide as their widest cell; on a terminal, as wide as it at most."""
    lines = [columns, *([one_line(cell) for cell in row] for row in rows)]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    if sys.stdout.isatty():
        widths = fitting(widths, shutil.get_terminal_size().columns)
    return "".join(_row(line, widths) for line in lines)


def _row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """A row of as many lines as its longest cell needs; words are not broken."""
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
    """A text of at most so many characters; `…` stands for its end."""
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"


def fitting(widths: Sequence[int], width: int) -> list[int]:
    """Widths of columns that fit: the widest are made narrower, the first one last.

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
    """Widths of which the largest are cut to one limit, so that all of them take the room."""
    limit = next(
        (
            limit
            for limit in range(max(widths, default=0), NARROWEST, -1)
            if sum(min(width, limit) for width in widths) <= room
        ),
        NARROWEST,
    )
    return [min(width, limit) for width in widths]


def runs_of_each(execution: Execution) -> str:
    """How often each configuration is run: `20`, or `3 to 50`."""
    runs = execution.runs
    return str(runs) if isinstance(runs, int) else f"{runs.min} to {runs.max}"


def _count(document: Document, variants: Sequence[Variant]) -> str:
    execution = document.vast.execution
    total = len(variants) * execution.most_runs
    each = "1 run" if execution.runs == 1 else f"{runs_of_each(execution)} runs"
    most = "at most " if execution.test() is not None else ""
    noun = "configuration" if len(variants) == 1 else "configurations"
    return f"{len(variants)} {noun}, {each} each: {most}{total} in all"


_FORMATS: Mapping[Format, Callable[[Sequence[Variant], bool], str]] = {
    "table": _table,
    "name": _names,
    "json": _json,
    "yaml": _yaml,
}
