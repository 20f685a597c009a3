"""Rows of the answer of a query as a table, CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any, Literal

from robovast_cli.ui.output import echo_data, json_list
from robovast_cli.ui.table import counted, format_table

Format = Literal["table", "csv", "json"]


def print_tables(columns: Mapping[str, Iterable[str]]) -> None:
    """Print tables with their columns."""
    rows = [[table, ", ".join(names)] for table, names in columns.items()]
    sys.stdout.write(format_table(["TABLE", "COLUMNS"], rows))


def cell_text(value: Any) -> str:
    """Return the text of a value in a table."""
    return f"{value:.10g}" if isinstance(value, float) else _text(value)


def print_rows(
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    output: Format,
    cell: Callable[[Any], str] = cell_text,
) -> None:
    """Print the rows of an answer; `cell` returns the text of a value in a table."""
    if output == "csv":
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_text(value) for value in row] for row in rows)
        echo_data(text.getvalue())
    elif output == "json":
        records = ({n: _jsonable(v) for n, v in zip(columns, row, strict=True)} for row in rows)
        encode = json.JSONEncoder(ensure_ascii=False, default=str).encode
        echo_data(json_list(map(encode, records)))
    else:
        cells = [[cell(value) for value in row] for row in rows]
        sys.stdout.write(f"{format_table(columns, cells)}\n{counted(len(cells), 'row')}\n")


def _jsonable(value: Any) -> Any:
    """A value as JSON has it: decimals as numbers if these are exact, and `"NaN"`, `"Infinity"` and
    `"-Infinity"`, as in the JSON form of Protocol Buffers."""
    if isinstance(value, list | tuple):
        return [_jsonable(each) for each in value]
    if isinstance(value, dict):
        return {str(key): _jsonable(each) for key, each in value.items()}
    if isinstance(value, Decimal) and Decimal(repr(float(value))) == value:
        return float(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


def _text(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)
