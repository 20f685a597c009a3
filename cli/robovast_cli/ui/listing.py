"""Configurations as a table, names, JSON or YAML; equal documents give equal bytes."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from robovast.base.printable import printable_json
from robovast.base.serialization import dump_yaml, spelled
from robovast.campaign.configurations import configuration_record
from robovast.model.document import Document
from robovast.model.document.execution import Execution
from robovast.model.expansion import Variant
from robovast_cli.ui.expanding import expanded
from robovast_cli.ui.table import WIDEST_CELL, format_table, shortened

Format = Literal["table", "name", "json", "yaml"]

_to_json = json.JSONEncoder(ensure_ascii=False, default=str).encode


def print_configurations(document: Document, output: Format, *, internal: bool) -> None:
    """Print what a document expands to.

    Args:
        document: a checked document.
        output: how.
        internal: also show keys that begin with `_`.
    """
    with expanded(document) as variants:
        text = _FORMATS[output](variants, internal)
    if output == "table":
        text += f"\n{_count(document, variants)}\n"
    sys.stdout.write(text)


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
    return shortened(spelled(value), WIDEST_CELL)


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
    return f"{len(variants)} {noun}, {each} each: {most}{total} in total"


_FORMATS: Mapping[Format, Callable[[Sequence[Variant], bool], str]] = {
    "table": _table,
    "name": _names,
    "json": _json,
    "yaml": _yaml,
}
