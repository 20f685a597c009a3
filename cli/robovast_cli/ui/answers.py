"""Answers of SPARQL queries as a table, CSV or JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from robovast.analysis.provenance.query import GraphAnswer, Graphs, query_names, read_query
from robovast.analysis.provenance.vocabulary import PREFIXES
from robovast.base.errors import InputError
from robovast.base.file_errors import read_text
from robovast.base.printable import printable_json
from robovast_cli.ui.output import say_data
from robovast_cli.ui.table import format_table

Format = Literal["table", "csv", "json"]


def print_query_names() -> None:
    """Print the names of the package's queries."""
    sys.stdout.write(format_table(["NAME", "DESCRIPTION"], query_names().items()))


def print_answer(query: str, campaigns: Sequence[Path], output: Format) -> None:
    """Print the answer of a query over campaigns.

    Args:
        query: name of a query of the package, a file, or `-`.
        campaigns: their folders.
        output: how.
    """
    text = _read(query)
    graphs = Graphs(campaigns)
    _FORMATS[output](graphs.ask(text), graphs)


def _read(query: str) -> str:
    if query in query_names():
        return read_query(query)
    if query == "-":
        try:
            return sys.stdin.read()
        except UnicodeDecodeError:
            raise InputError("-: is not text in UTF-8.", hint="save the text in UTF-8") from None
    path = Path(query)
    return read_text(path) if path.is_file() else read_query(query)


def _print_csv(answer: GraphAnswer, graphs: Graphs) -> None:
    del graphs
    say_data(answer.csv())


def _print_json(answer: GraphAnswer, graphs: Graphs) -> None:
    del graphs
    lines = (
        json.dumps(dict(zip(answer.columns, row, strict=True)), ensure_ascii=False)
        for row in answer
    )
    say_data(printable_json("[\n" + ",\n".join(lines) + "\n]\n"))


def _print_table(answer: GraphAnswer, graphs: Graphs) -> None:
    shorten = _shortener(graphs)
    rows = [[shorten(value) for value in row] for row in answer]
    noun = "row" if len(rows) == 1 else "rows"
    sys.stdout.write(f"{format_table(answer.columns, rows)}\n{len(rows)} {noun}\n")


def _shortener(graphs: Graphs) -> Callable[[Any], str]:
    """Writes IRIs as short as they are clear: relative to the campaign, or with a prefix."""
    bases = list(graphs.campaigns)
    names = {iri: f"{folder.absolute().name}/" for iri, folder in graphs.campaigns.items()}
    short = {bases[0]: ""} if len(bases) == 1 else names

    def shorten(value: Any) -> str:
        if not isinstance(value, str):
            return _text(value)
        base = next((base for base in bases if value.startswith(base)), None)
        if base is not None:
            return short[base] + value.removeprefix(base) or "."
        prefix = next((p for p, iri in PREFIXES.items() if value.startswith(iri)), None)
        return f"{prefix}:{value.removeprefix(PREFIXES[prefix])}" if prefix else value

    return shorten


def _text(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value).lower()


_FORMATS: Mapping[Format, Callable[[GraphAnswer, Graphs], None]] = {
    "table": _print_table,
    "csv": _print_csv,
    "json": _print_json,
}
