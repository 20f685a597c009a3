"""`vast config export-configs` and `import-configs`: entries with fixed parameters."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from robovast.base.atomic import write_atomically
from robovast.base.errors import DocumentError, InputError, RobovastError
from robovast.base.file_errors import read_content, writing
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import compose_yaml
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.model.document import load_document
from robovast.model.document.declared import apply_types
from robovast.model.document.loader import Document, check_source
from robovast.model.document.source import Source
from robovast.model.expansion import Variant, select_any
from robovast.model.scenario import Scenario, read_scenario
from robovast_cli.lazy import examples
from robovast_cli.ui.expansion import expanded_variants
from robovast_cli.ui.output import ask
from robovast_cli.ui.report import echo_stderr
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown

_DOCUMENTS = {".vast", ".yaml", ".yml"}


@examples(
    ("vast config export-configs hall-3 failed.yaml", "Export one configuration to a file"),
    ("vast config export-configs 'hall-*' -o failed.yaml", "Export a selection"),
)
def export_configs(
    ctx: typer.Context,
    patterns: Annotated[
        list[str],
        typer.Argument(
            metavar="PATTERN",
            help="Names or globs of configurations. The last one may be the output file "
            "(`*.vast`, `*.yaml`, `*.yml`).",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Output file (default: stdout)."),
    ] = None,
    source: Annotated[
        Path | None, typer.Option("--input", metavar="VAST_FILE", help="Same as `vast -V`.")
    ] = None,
) -> None:
    """Export configurations with fixed parameters.

    `vast config import-configs` adds them to another .vast file, in order to run them again.
    """
    if output is None and len(patterns) > 1 and Path(patterns[-1]).suffix in _DOCUMENTS:
        output = Path(patterns.pop())
    ctx.obj.vast_file = source or ctx.obj.vast_file
    _export(ctx.obj.document(), patterns, output)


def _export(document: Document, patterns: Sequence[str], output: Path | None) -> None:
    """Write the configurations that match any of the patterns, in the document's order.

    Raises:
        InputError: a pattern matches nothing, or a configuration needs files of its own.
        StorageError: the file exists or cannot be written.
    """
    with expanded_variants(document) as variants:
        entries = [_entry(variant) for variant in select_any(variants, patterns)]
    text = dump_yaml({"version": 1, "configuration": entries})
    if output is None:
        sys.stdout.write(text)
        return
    if output.exists() and sys.stdin.isatty():
        if not ask(f"{output} exists. Replace it?", default=True):
            return
        output.unlink()
    with writing(output), output.open("x", encoding="utf-8") as file:
        file.write(text)
    typer.echo(f"Wrote {counted(len(entries), 'configuration')} to {output}.")


@examples(
    ("vast -V robot.vast config import-configs failed.yaml", "Add exported configurations"),
    ("vast config import-configs results/hall-2026-03-04-152130", "Add its configurations"),
)
def import_configs(
    ctx: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE", help="Exported configurations, a .vast file or a campaign."
        ),
    ],
) -> None:
    """Add exported configurations to the .vast file.

    Existing text and comments are not modified.
    """
    target: Path = ctx.obj.path
    document = load_document(target)
    read = _read_entries(source, read_scenario(document.scenario))
    _reject_existing_names(document, read)
    entries = [entry for entry in read if _is_usable(document, entry, source)]
    if not entries:
        raise InputError(
            f"{source}: no configuration can be used in {target}.",
            hint="use an entry with parameters that exist in both files",
        )
    text = append_entries(read_content(target).decode(), entries, target)
    _reject_generated_names(check_source(Source(target, text)), source)
    with writing(target):
        mode = target.stat().st_mode
        write_atomically(target.resolve(), text)
        target.chmod(mode)
    typer.echo(f"Added {counted(len(entries), 'configuration')} to {shown(target)}.")


def _reject_existing_names(document: Document, entries: Sequence[Any]) -> None:
    known = {entry.name for entry in document.vast.configuration or ()}
    names = [entry.get("name") for entry in entries if isinstance(entry, dict)]
    existing = [name for name in names if name in known]
    if existing:
        raise InputError(
            f"{document.path}: configurations with these names exist already: "
            f"{', '.join(existing)}",
            hint="rename them in one of the files",
        )


def _reject_generated_names(document: Document, source: Path) -> None:
    """Raise an InputError if variations create configurations with equal names."""
    try:
        with expanded_variants(document):
            pass
    except InputError as error:
        message = f"{source}: no configuration was added, because {error.message}"
        raise InputError(message, hint=error.hint) from None


def _is_usable(document: Document, entry: Any, source: Path) -> bool:
    """Return whether an entry alone can be expanded; print the reason if not."""
    data = {**document.source.data, "configuration": [entry]}
    try:
        single = check_source(Source(document.path, dump_yaml(data)))
        with expanded_variants(single):
            return True
    except DocumentError as error:
        cause = "; ".join(f"{problem.key}: {problem.message}" for problem in error.problems)
    except RobovastError as error:
        cause = str(error)
    name = entry.get("name") if isinstance(entry, dict) else entry
    echo_stderr(f"{source}: `{name}` is skipped: {cause}")
    return False


def append_entries(text: str, entries: Sequence[Any], file: Path) -> str:
    """Return the text of a .vast file with added entries; existing text is not changed.

    Raises:
        InputError: the file, or its `configuration`, is written in brackets.
    """
    root = next(compose_yaml(text), None)
    pairs = root.value if isinstance(root, yaml.MappingNode) else []
    found = next((value for key, value in pairs if key.value == "configuration"), None)
    _reject_flow_style(root, file)
    _reject_flow_style(found, file)
    if not isinstance(found, yaml.SequenceNode):
        return _with_section(text, entries, found)
    position = _end_of_line(text, _last_mark(found).index)
    return _inserted(text, position, _indented(dump_yaml(entries), found.start_mark.column))


def _reject_flow_style(node: yaml.Node | None, file: Path) -> None:
    if isinstance(node, yaml.CollectionNode) and node.flow_style:
        mark = node.start_mark
        raise InputError(
            f"{file}:{mark.line + 1}:{mark.column + 1}: YAML in brackets cannot be extended",
            hint="write `configuration:` with one `- name: …` per line",
        )


def _with_section(text: str, entries: Sequence[Any], empty: yaml.Node | None) -> str:
    """Return the text with a new `configuration` list, also in place of an empty one."""
    if empty is None:
        return _inserted(text, len(text), dump_yaml({"configuration": entries}))
    return _inserted(text, _end_of_line(text, empty.end_mark.index), dump_yaml(entries))


def _last_mark(node: yaml.Node) -> yaml.Mark:
    """Return the end of the last value of a node, which is before trailing comments."""
    if isinstance(node, yaml.ScalarNode) or not node.value:
        return node.end_mark
    children = node.value if isinstance(node, yaml.SequenceNode) else sum(node.value, ())
    return max((_last_mark(child) for child in children), key=lambda mark: mark.index)


def _end_of_line(text: str, position: int) -> int:
    if position and text[position - 1] == "\n":
        return position
    end = text.find("\n", position)
    return len(text) if end < 0 else end + 1


def _inserted(text: str, position: int, addition: str) -> str:
    before, after = text[:position], text[position:]
    newline = "\r\n" if "\r\n" in text else "\n"
    separator = "" if not before or before.endswith("\n") else newline
    return before + separator + addition.replace("\n", newline) + after


def _indented(text: str, column: int) -> str:
    return "".join(" " * column + line for line in text.splitlines(keepends=True))


def _read_entries(source: Path, scenario: Scenario) -> list[Any]:
    if source.is_dir():
        return [_entry(variant) for variant in read_variants(Layout(source))]
    read = Source.read(source)
    apply_types(read, scenario)
    data = read.data
    entries = data.get("configuration") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f"{source}: no `configuration` list to import.",
            hint="name a .vast file with configurations",
        )
    return entries


def _entry(variant: Variant) -> dict[str, Any]:
    if variant.files:
        names = ", ".join(file.name for file in variant.files)
        raise InputError(
            f"cannot export `{variant.name}` with fixed parameters: its variations create files "
            f"({names})",
            hint="exclude the configuration, or keep its variations",
        )
    parameters = [
        {name: value} for name, value in variant.parameters.items() if not name.startswith("_")
    ]
    return {"name": variant.name, **({"parameters": parameters} if parameters else {})}
