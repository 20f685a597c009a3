"""Sets the line `DATA_DIR = …` of a notebook."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.base.errors import InputError

if TYPE_CHECKING:
    from nbformat import NotebookNode

_LINE = re.compile(r"^([ \t]*)DATA_DIR[ \t]*(?::[^=\n]*)?=(?!=).*$", re.MULTILINE)


def replace_line(source: str, data_dir: Path) -> tuple[str, int]:
    """Code with the line replaced, and the number of replacements."""
    return _LINE.subn(lambda line: f"{line[1]}DATA_DIR = {str(data_dir)!r}", source)


def read_notebook(content: bytes, data_dir: Path) -> NotebookNode:
    """Read a notebook, set its `DATA_DIR` and remove outputs.

    Raises:
        InputError: it is not a notebook, or lacks the line.
    """
    import nbformat

    try:
        notebook: NotebookNode = nbformat.reads(content.decode(), as_version=4)
    except Exception as error:  # nbformat documents no specific exceptions
        raise InputError(f"It is not a Jupyter notebook: {error}") from None
    replaced = 0
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
            cell.source, times = replace_line(cell.source, data_dir)
            replaced += times
    if not replaced:
        raise InputError("It has no line `DATA_DIR = ''`, which tells it where its data is.")
    return notebook
