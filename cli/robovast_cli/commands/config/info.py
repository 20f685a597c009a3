"""`vast config info`, `check`, `schema`, `variation-types` and `variation-points`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any, NoReturn

import typer
from pydantic import BaseModel

from robovast.base.errors import DocumentError, InputError, RobovastError
from robovast.base.plugins import plugins_of
from robovast.base.statistics import percent
from robovast.compat.differences import differences
from robovast.execution.local.scenario_syntax import check_syntax
from robovast.model.designs import coverages, rows_of
from robovast.model.document import Document
from robovast.model.document.execution import Execution, Resources
from robovast.model.document.gpus import check_gpus
from robovast.model.document.model import ConfigurationEntry
from robovast.model.document.schema import schema_text
from robovast.model.document.source import KeyPath
from robovast.model.expansion import Variant
from robovast.model.expansion.designed import design_sizes
from robovast.model.quantities import (
    LOCAL_CONTEXT,
    parse_cpus,
    parse_disk,
    parse_gpus,
    parse_memory,
    parse_memory_limit,
)
from robovast.model.scenario import read_scenario
from robovast_cli.commands.config.listing import runs_of_each
from robovast_cli.lazy import examples
from robovast_cli.plugins import origin
from robovast_cli.ui.expansion import expanded_variants
from robovast_cli.ui.report import echo_stderr, message_of
from robovast_cli.ui.table import counted, format_table

MOST_ERRORS = 20
"""Maximum number of errors of a check."""


@examples(
    ("vast config info", "Summarize the .vast file of the project"),
    ("vast -V robot.vast config info", "Summarize robot.vast"),
)
def info(ctx: typer.Context) -> None:
    """Summarize the campaign that the .vast file describes."""
    document = ctx.obj.document()
    with expanded_variants(document) as variants:
        entries = _entries(document, variants)
    pairs = [[name, value] for name, value in _facts(document) if value]
    typer.echo(format_table(["file", str(document.path)], pairs))
    typer.echo(entries, nl=False)
    for line in _designs(document):
        typer.echo(line)


@examples(
    ("vast config check", "Check the .vast file of the project"),
    ("vast -V robot.vast config check", "Check robot.vast"),
)
def check(ctx: typer.Context) -> None:
    """Check the .vast file, and warn about keys without effect.

    Also lists differences from the original RoboVAST that affect the file.
    """
    document = ctx.obj.document(parse_scenario=False)
    for difference in differences(document):
        typer.echo(f"differs from the original RoboVAST: {difference}", err=True)
    errors: list[RobovastError] = []
    with _collect_errors(errors):
        _check_resources(document)
    with _collect_errors(errors):
        check_gpus(document)
    with _collect_errors(errors):
        check_syntax(document.scenario)
    with _collect_errors(errors):
        count = _count(document)
    if errors:
        for entry in document.vast.configuration or ():
            with _collect_errors(errors):
                vast = document.vast.model_copy(update={"configuration": [entry]})
                _count(replace(document, vast=vast))
        _raise_all(errors)
    warnings = f", {counted(len(document.warnings), 'warning')}" if document.warnings else ""
    typer.echo(f"{document.source.file}: valid, {counted(count, 'configuration')}{warnings}")


@contextmanager
def _collect_errors(errors: list[RobovastError]) -> Iterator[None]:
    """Add an error to a list, unless the list is full or contains the same error."""
    try:
        yield
    except RobovastError as error:
        if len(errors) < MOST_ERRORS and str(error) not in map(str, errors):
            errors.append(error)


def _raise_all(errors: Sequence[RobovastError]) -> NoReturn:
    """Print all errors but one, and raise this one, preferably an InputError."""
    *others, last = sorted(errors, key=lambda error: isinstance(error, InputError))
    for error in others:
        echo_stderr(message_of(error))
    raise last


def _count(document: Document) -> int:
    with expanded_variants(document) as variants:
        return len(variants)


def _check_resources(document: Document) -> None:
    """Raise a DocumentError with all invalid quantities."""
    execution, source = document.vast.execution, document.source
    problems = [
        source.problem(("execution", *path), message)
        for path, value, parse in _quantities(execution)
        for message in _invalid_quantities(value, parse)
    ]
    if problems:
        raise DocumentError(problems)


def _quantities(execution: Execution) -> Iterator[tuple[KeyPath, Any, Callable[[Any], float]]]:
    """Yield key path, value and parser of each quantity in the section `execution`."""
    containers: dict[KeyPath, Resources] = {("resources",): execution.resources}
    for number, container in enumerate(execution.secondary_containers):
        containers["secondary_containers", number] = container.resources
    for path, resources in containers.items():
        yield (*path, "cpu"), resources.cpu, parse_cpus
        yield (*path, "memory"), resources.memory, parse_memory_limit
        yield (*path, "gpu"), resources.gpu, parse_gpus
    yield ("resources", "shm_size"), execution.resources.shm_size, parse_memory
    disk = execution.kubernetes.ephemeral_storage
    yield ("kubernetes", "ephemeral_storage"), disk, parse_disk


def _invalid_quantities(value: Any, parse: Callable[[Any], float]) -> Iterator[str]:
    """Yield the errors of a quantity, or of a list with a quantity for each context."""
    items = value if isinstance(value, list) else [{LOCAL_CONTEXT: value}]
    for amount in (amount for item in items for amount in item.values() if amount is not None):
        try:
            parse(amount)
        except InputError as error:
            yield str(error)


@examples(
    ("vast config variation-points", "List parameters of the project's scenario"),
    ("vast -V robot.vast config variation-points", "List parameters of the scenario of robot.vast"),
)
def variation_points(ctx: typer.Context) -> None:
    """List the scenario parameters that variations can set."""
    scenario = read_scenario(ctx.obj.document().scenario)
    rows = [[p.name, p.type, _text(p.default_text)] for p in scenario.parameters]
    typer.echo(format_table(["PARAMETER", "TYPE", "DEFAULT"], rows), nl=False)


@examples(
    ("vast config variation-types", "List all types with their parameters"),
    ("vast config variation-types | less", "Show the list page by page"),
)
def variation_types() -> None:
    """List the installed variation types and their parameters."""
    points = sorted(plugins_of("robovast.variation_types").values(), key=lambda point: point.name)
    blocks = map(_variation_type, points)
    typer.echo("\n\n".join("\n".join(lines) for lines in blocks))


@examples(
    ("vast config schema", "Print the schema"),
    ("vast config schema > vast.schema.json", "Write the schema to a file"),
)
def schema() -> None:
    """Print the JSON Schema of .vast files, for editors."""
    typer.echo(schema_text(), nl=False)


def _facts(document: Document) -> Iterator[tuple[str, str]]:
    vast, execution = document.vast, document.vast.execution
    yield "title", str(vast.metadata.get("title") or "")
    yield "campaign", vast.campaign_name
    yield "scenario", f"{read_scenario(document.scenario).name} ({vast.scenario_file})"
    yield "image", execution.image or "none (local processes)"
    yield "runs per configuration", runs_of_each(execution)
    yield "runs per job", str(execution.runs_per_job)
    yield "seed", "random" if execution.seed is None else str(execution.seed)
    yield "timeout", f"{execution.timeout} s per run" if execution.timeout else "none"
    yield "run files", ", ".join(execution.run_files)
    yield "secondary containers", ", ".join(c.name for c in execution.secondary_containers)
    yield "notebooks", ", ".join(vast.visualization)
    yield "postprocessing", ", ".join(call.name for call in vast.postprocessing)


def _entries(document: Document, variants: Sequence[Variant]) -> str:
    counts = Counter(variant.entry for variant in variants)
    runs = document.vast.execution.most_runs
    entries = {
        entry.name: _describe_variations(entry) for entry in document.vast.configuration or []
    }
    rows = [
        [name, entries.get(name, "scenario defaults"), str(count), str(count * runs)]
        for name, count in counts.items()
    ]
    rows.append(["total", "", str(len(variants)), str(len(variants) * runs)])
    return format_table(["ENTRY", "VARIATIONS", "CONFIGURATIONS", "RUNS"], rows)


def _describe_variations(entry: ConfigurationEntry) -> str:
    if entry.variations:
        product = " * ".join(call.name for call in entry.variations)
        return f"{product}, {entry.design.kind}" if entry.design else product
    return "fixed parameters" if entry.parameters else "scenario defaults"


def _designs(document: Document) -> Iterator[str]:
    """Yield the share of the product that each combination design covers."""
    for entry in document.vast.configuration or ():
        if entry.design is not None:
            sizes = design_sizes(entry, document.folder)
            rows = rows_of(entry.design, sizes)
            covered = [
                f"{w} {a} of {b} ({percent(a / b)})" for w, (a, b) in coverages(rows, sizes).items()
            ]
            product = f"{len(rows):,} of {math.prod(sizes):,} combinations"
            yield f"{entry.name}: {product}; {', '.join(covered)}"


def _variation_type(point: EntryPoint) -> Iterator[str]:
    yield f"{point.name}  ({origin(point)})"
    try:
        variation = point.load()
    except Exception as error:  # a plugin's code may raise anything
        yield f"    cannot be loaded: {type(error).__name__}: {error}"
        return
    summary = (variation.__doc__ or "").strip().partition("\n")[0]
    yield from [f"    {summary}"] if summary else []
    model: type[BaseModel] | None = variation.CONFIG_CLASS
    if model is not None:
        rows = [[f"    {name}", *_field(field)] for name, field in model.model_fields.items()]
        yield format_table(["", "", ""], rows).strip("\n")


def _field(field: Any) -> list[str]:
    default = "required" if field.is_required() else f"default {_text(field.get_default())}"
    return [default, field.description or ""]


def _text(value: Any) -> str:
    return "none" if value is None else str(value)
