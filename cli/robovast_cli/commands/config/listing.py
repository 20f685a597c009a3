"""`vast config list`: configurations as a table, names, JSON or YAML."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

import typer

from robovast.base.serialization import dump_yaml, spelled
from robovast.campaign.configurations import configuration_record
from robovast.model.document import Document
from robovast.model.document.execution import Execution
from robovast.model.expansion import Variant
from robovast_cli.lazy import examples
from robovast_cli.ui.expansion import expanded_variants
from robovast_cli.ui.output import json_list
from robovast_cli.ui.table import WIDEST_CELL, counted, format_table, shortened

Format = Literal["table", "name", "json", "yaml"]

_to_json = json.JSONEncoder(ensure_ascii=False, default=str).encode


@examples(
    ("vast -V robot.vast config list", "Print a table"),
    ("vast -V robot.vast config list -o json", "Print JSON"),
)
def list_(
    ctx: typer.Context,
    output: Annotated[Format, typer.Option("-o", "--output", help="Output format.")] = "table",
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="Also show keys that start with `_`: entry, files and variations of each "
            "configuration, and internal values of variation types.",
        ),
    ] = False,
) -> None:
    """List the configurations of the .vast file."""
    print_configurations(ctx.obj.document(), output, internal=debug)


def gui(ctx: typer.Context, debug: Annotated[bool, typer.Option("--debug")] = False) -> None:
    """List the configurations, as `vast config list`: RoboVAST has no built-in editor."""
    typer.echo(
        "note: `vast` has no editor for configurations. Use your own editor with the schema of "
        "`vast config schema`, or draw configurations with `vast config view OUT`. The output "
        "below comes from `vast config list`.",
        err=True,
    )
    print_configurations(ctx.obj.document(), "table", internal=debug)


def print_configurations(document: Document, output: Format, *, internal: bool) -> None:
    """Print the configurations of a document, with `internal` also keys that begin with `_`."""
    with expanded_variants(document) as variants:
        text = _FORMATS[output](variants, internal)
    if output == "table":
        text += f"\n{_count(document, variants)}\n"
    sys.stdout.write(text)


def record(variant: Variant, *, internal: bool) -> dict[str, Any]:
    """Return a configuration as plain data."""
    if internal:
        return configuration_record(variant, timings=False)
    return {"name": variant.name, "config": _public(variant.parameters), **_public(variant.extra)}


def _public(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if not name.startswith("_")}


def _names(variants: Sequence[Variant], internal: bool) -> str:
    del internal
    return "".join(f"{variant.name}\n" for variant in variants)


def _json(variants: Sequence[Variant], internal: bool) -> str:
    return json_list(_to_json(record(variant, internal=internal)) for variant in variants)


def _yaml(variants: Sequence[Variant], internal: bool) -> str:
    return dump_yaml([record(variant, internal=internal) for variant in variants])


def _table(variants: Sequence[Variant], internal: bool) -> str:
    """Return a table with a row for each configuration and a column for each parameter."""
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
    values = {**whole, **parameters}
    return {key: shortened(spelled(value), WIDEST_CELL) for key, value in values.items()}


def runs_of_each(execution: Execution) -> str:
    """Return the number of runs of each configuration: `20`, or `3 to 50`."""
    runs = execution.runs
    return str(runs) if isinstance(runs, int) else f"{runs.min} to {runs.max}"


def _count(document: Document, variants: Sequence[Variant]) -> str:
    execution = document.vast.execution
    total = len(variants) * execution.most_runs
    each = "1 run" if execution.runs == 1 else f"{runs_of_each(execution)} runs"
    most = "at most " if execution.test() is not None else ""
    return f"{counted(len(variants), 'configuration')}, {each} each: {most}{total} in total"


_FORMATS: Mapping[Format, Callable[[Sequence[Variant], bool], str]] = {
    "table": _table,
    "name": _names,
    "json": _json,
    "yaml": _yaml,
}
