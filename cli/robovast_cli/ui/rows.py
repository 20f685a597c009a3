"""Answers of SQL queries as a table, CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from typing import Any, Literal

from robovast.analysis.tables.query import Answer
from robovast.base.printable import printable_json
from robovast_cli.ui.output import say_data
from robovast_cli.ui.table import format_table

Format = Literal["table", "csv", "json"]


def print_tables(columns: Mapping[str, Iterable[str]]) -> None:
    """Print tables with their columns."""
    rows = [[table, ", ".join(names)] for table, names in columns.items()]
    sys.stdout.write(format_table(["TABLE", "COLUMNS"], rows))


def print_rows(answer: Answer, output: Format) -> None:
    """Print the answer of a query."""
    _FORMATS[output](answer)


def _print_csv(answer: Answer) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(answer.columns)
    writer.writerows([_text(value) for value in row] for row in answer.rows)
    say_data(text.getvalue())


def _print_json(answer: Answer) -> None:
    lines = (
        json.dumps(
            {name: _jsonable(v) for name, v in zip(answer.columns, row, strict=True)},
            ensure_ascii=False,
            default=str,
        )
        for row in answer.rows
    )
    say_data(printable_json("[\n" + ",\n".join(lines) + "\n]\n"))


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


def _print_table(answer: Answer) -> None:
    rows = [[_cell(value) for value in row] for row in answer.rows]
    noun = "row" if len(rows) == 1 else "rows"
    sys.stdout.write(f"{format_table(answer.columns, rows)}\n{len(rows)} {noun}\n")


def _text(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _cell(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else _text(value)


_FORMATS: Mapping[Format, Callable[[Answer], None]] = {
    "table": _print_table,
    "csv": _print_csv,
    "json": _print_json,
}
