"""Configurations as a table, names, JSON or YAML; equal documents give equal bytes."""

from __future__ import annotations

import contextlib
import gc
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from robovast.base.printable import one_line
from robovast.base.serialization import dump_yaml
from robovast.campaign.configurations import configuration_record
from robovast.model.document import Document
from robovast.model.expansion import Variant
from robovast_cli.ui.expanding import expanded

Format = Literal["table", "name", "json", "yaml"]

WIDEST_CELL = 40

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
    return "[\n" + ",\n".join(lines) + "\n]\n"


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
    text = value if isinstance(value, str) else _to_json(value)
    return text if len(text) <= WIDEST_CELL else text[: WIDEST_CELL - 1] + "…"


def format_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Text in columns as wide as their widest cell."""
    lines = [columns, *([one_line(cell) for cell in row] for row in rows)]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    template = "  ".join(f"{{:<{width}}}" for width in widths)
    return "".join(f"{template.format(*line).rstrip()}\n" for line in lines)


def _count(document: Document, variants: Sequence[Variant]) -> str:
    runs = document.vast.execution.runs
    total = len(variants) * runs
    each = "1 run" if runs == 1 else f"{runs} runs"
    noun = "configuration" if len(variants) == 1 else "configurations"
    return f"{len(variants)} {noun}, {each} each: {total} in all"


_FORMATS: Mapping[Format, Callable[[Sequence[Variant], bool], str]] = {
    "table": _table,
    "name": _names,
    "json": _json,
    "yaml": _yaml,
}
