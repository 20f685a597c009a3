"""Sets the lines `DATA_DIR = …` and `BATCH = …` of a notebook."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.base.errors import InputError

if TYPE_CHECKING:
    from nbformat import NotebookNode


def replace_line(source: str, name: str, value: str | int) -> tuple[str, int]:
    """Code with the line that sets a name replaced, and the number of replacements."""
    line = re.compile(rf"^([ \t]*){name}[ \t]*(?::[^=\n]*)?=(?!=).*$", re.MULTILINE)
    return line.subn(lambda found: f"{found[1]}{name} = {value!r}", source)


def read_notebook(content: bytes, data_dir: Path, batch: int | None = None) -> NotebookNode:
    """Read a notebook, set its `DATA_DIR` and remove outputs.

    Args:
        content: of its file.
        data_dir: the folder of its data.
        batch: also set its `BATCH`, the number of a search's batch.

    Raises:
        InputError: it is not a notebook, or lacks a line.
    """
    import nbformat

    try:
        notebook: NotebookNode = nbformat.reads(content.decode(), as_version=4)
    except Exception as error:  # nbformat documents no specific exceptions
        raise InputError(f"It is not a Jupyter notebook: {error}") from None
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in cells:
        cell.outputs, cell.execution_count = [], None
    if not _set(cells, "DATA_DIR", str(data_dir)):
        raise InputError(
            "The notebook has no line `DATA_DIR = ''` for the path of its data",
            hint="add this line to the notebook",
        )
    if batch is not None:
        _set(cells, "BATCH", batch)
    return notebook


def _set(cells: Iterable[NotebookNode], name: str, value: str | int) -> int:
    """Set a name in all cells; return how often."""
    replaced = 0
    for cell in cells:
        cell.source, times = replace_line(cell.source, name, value)
        replaced += times
    return replaced
