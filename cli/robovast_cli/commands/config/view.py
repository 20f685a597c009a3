"""`vast config view`: draws each configuration that has a map."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import typer

from robovast.base.errors import InputError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.base.optional_deps import NAV
from robovast.model.document import Document
from robovast.model.expansion import Selection, Variant, select_any
from robovast.model.naming import CONFIG_MOUNT
from robovast.navigation.base import RECORD
from robovast_cli.ui.expanding import expanded
from robovast_cli.ui.working import working
from robovast_cli.workspace import shown

Format = Literal["svg", "png"]


def write_pictures(document: Document, selection: Selection, out: Path, kind: Format) -> None:
    """Write `OUT/<configuration>.<kind>` for each configuration with a map.

    Args:
        document: a checked document.
        selection: names or globs of configurations; all when there is none.
        out: folder; made when it does not exist.
        kind: format of the pictures.

    Raises:
        InputError: no configuration has a map.
        StorageError: the folder cannot be written.
    """
    with expanded(document) as variants, working("Drawing") as tell:
        mapped = [
            variant
            for variant in select_any(variants, selection)
            if _record(variant).get("map_file")
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
                tell(variant.name)
                (out / f"{variant.name}.{kind}").write_bytes(_picture(document, variant, kind))
    noun = "image" if len(mapped) == 1 else "images"
    typer.echo(f"Wrote {len(mapped)} {noun} to {shown(out)}.")


def _record(variant: Variant) -> dict[str, Any]:
    record: dict[str, Any] = variant.extra.get(RECORD) or {}
    return record


def _picture(document: Document, variant: Variant, kind: Format) -> bytes:
    with NAV.needed_by("`vast config view`"):
        from robovast.navigation.occupancy import read_map
        from robovast.navigation.picture import marks, to_png, to_svg
    record = _record(variant)
    name = str(record["map_file"]).removeprefix(CONFIG_MOUNT)
    files = {file.name: file.source for file in variant.files}
    occupancy = read_map(files.get(name, document.folder / name))
    found = list(marks(record, variant.parameters))
    if kind == "png":
        return to_png(occupancy, found, variant.name)
    return to_svg(occupancy, found, variant.name).encode()
