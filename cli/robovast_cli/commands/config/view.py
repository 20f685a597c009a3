"""`vast config view`: draw each configuration that has a map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from robovast.base.errors import InputError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.base.optional_deps import NAV
from robovast.model.document import Document
from robovast.model.expansion import Variant, select_any
from robovast.model.naming import CONFIG_MOUNT
from robovast.navigation.base import RECORD
from robovast_cli.lazy import examples
from robovast_cli.ui.expansion import expanded_variants
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown

Format = Literal["svg", "png"]


@examples(
    ("vast config view drawings", "Draw all configurations"),
    ("vast config view drawings -c 'hall-*' --format png", "Draw a selection as PNG"),
)
def view(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for the images.")],
    config: Annotated[
        list[str] | None,
        typer.Option(
            "-c",
            "--config",
            metavar="NAME|GLOB",
            help="Select configurations by name, entry or glob (repeatable).",
        ),
    ] = None,
    format_: Annotated[Format, typer.Option("--format", help="Image format.")] = "svg",
) -> None:
    """Draw the map, start, goals, path and obstacles of configurations."""
    document = ctx.obj.document()
    with expanded_variants(document) as variants, progress_line("Drawing") as show:
        mapped = [
            variant for variant in select_any(variants, config) if _record(variant).get("map_file")
        ]
        if not mapped:
            raise InputError(
                f"{document.path}: no configuration has a map to draw",
                hint="use a floor plan, path or obstacle variation",
            )
        refuse_obstacle(out)
        with writing(out):
            out.mkdir(parents=True, exist_ok=True)
            for variant in mapped:
                show(variant.name)
                content = _picture(document, variant, format_)
                (out / f"{variant.name}.{format_}").write_bytes(content)
    typer.echo(f"Wrote {counted(len(mapped), 'image')} to {shown(out)}.")


def _record(variant: Variant) -> dict[str, Any]:
    record: dict[str, Any] = variant.extra.get(RECORD) or {}
    return record


def _picture(document: Document, variant: Variant, kind: Format) -> bytes:
    with NAV.needed_by("`vast config view`"):
        from robovast.navigation.drawing import marks, to_png, to_svg
        from robovast.navigation.occupancy import read_map
    record = _record(variant)
    name = str(record["map_file"]).removeprefix(CONFIG_MOUNT)
    files = {file.name: file.source for file in variant.files}
    occupancy = read_map(files.get(name, document.folder / name))
    found = list(marks(record, variant.parameters))
    if kind == "png":
        return to_png(occupancy, found, variant.name)
    return to_svg(occupancy, found, variant.name).encode()
