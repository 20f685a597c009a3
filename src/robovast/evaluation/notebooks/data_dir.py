"""The line `DATA_DIR = …` of a notebook, which says where its data is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.base.errors import InputError

if TYPE_CHECKING:
    from nbformat import NotebookNode

_LINE = re.compile(r"^([ \t]*)DATA_DIR[ \t]*(?::[^=\n]*)?=(?!=).*$", re.MULTILINE)


def replace_line(source: str, data_dir: Path) -> tuple[str, int]:
    """Code with the line replaced, and how often it was there."""
    return _LINE.subn(lambda line: f"{line[1]}DATA_DIR = {str(data_dir)!r}", source)


def read_notebook(content: bytes, data_dir: Path) -> NotebookNode:
    """A notebook whose `DATA_DIR` is a folder; without outputs.

    Raises:
        InputError: it is no notebook, or has no such line.
    """
    import nbformat

    try:
        notebook: NotebookNode = nbformat.reads(content.decode(), as_version=4)
    except Exception as error:  # nbformat promises none in particular
        raise InputError(f"It is no Jupyter notebook: {error}") from None
    replaced = 0
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
            cell.source, times = replace_line(cell.source, data_dir)
            replaced += times
    if not replaced:
        raise InputError("It has no line `DATA_DIR = ''`, which tells it where its data is.")
    return notebook
