"""Executes one notebook in a separate process with its own kernel.

    python -m robovast.evaluation.notebooks.child FOLDER

FOLDER holds `request.json`; `output.html` (if there is any) and `result.json` are written there.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.base.errors import InputError
from robovast.base.file_errors import read_content

if TYPE_CHECKING:
    from nbformat import NotebookNode

LARGEST = 64 << 20
"""Largest HTML [bytes]."""
LONGEST = 500
"""Longest message of an exception [characters]."""


def main() -> None:
    """Execute the request."""
    folder = Path(sys.argv[1])
    request = json.loads((folder / "request.json").read_text())
    begin = time.monotonic()
    try:
        fault = _work(folder, request)
    except InputError as error:
        fault = str(error)
    result = {"fault": fault, "seconds": time.monotonic() - begin, "ended": time.time()}
    (folder / "result.json").write_text(json.dumps(result))


def _work(folder: Path, request: dict[str, Any]) -> str:
    from robovast.evaluation.notebooks.data_dir import read_notebook
    from robovast.evaluation.notebooks.document import html_of

    content = read_content(Path(request["notebook"]))
    notebook = read_notebook(content, Path(request["data_dir"]), request["batch"])
    fault = execute(notebook, Path(request["notebook"]).parent, request["timeout"])
    html = html_of(notebook).encode("utf-8", "replace")
    if len(html) > LARGEST:
        raise InputError(f"Its output is larger than {LARGEST >> 20} MiB", hint="let it print less")
    (folder / "output.html").write_bytes(html)
    return fault


def execute(notebook: NotebookNode, folder: Path, timeout: float) -> str:
    """Execute all cells, or those up to a failure; outputs are stored in the notebook.

    Args:
        notebook: the notebook.
        folder: the kernel's working directory.
        timeout: time limit for all cells together [s].

    Returns:
        The error and its cell; empty if there was none.
    """
    from jupyter_client.kernelspec import KernelSpecManager
    from jupyter_client.manager import AsyncKernelManager
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError

    deadline: float | None = None
    reached = 0

    def begin(cell_index: int, **_: Any) -> None:
        nonlocal deadline, reached
        deadline = deadline or time.monotonic() + timeout
        reached = cell_index + 1

    def left(_: Any) -> int:
        return max(1, round((deadline or 0) - time.monotonic()))

    # Of all installed kernels, only this Python's can import RoboVAST.
    specs = KernelSpecManager(kernel_dirs=[])
    client = NotebookClient(
        notebook,
        km=AsyncKernelManager(kernel_name="python3", kernel_spec_manager=specs),
        resources={"metadata": {"path": str(folder)}},
        timeout_func=left,
        shutdown_kernel="immediate",
        on_cell_start=begin,
    )
    try:
        client.execute()
    except CellExecutionError as error:
        return f"Cell {reached} failed: {error.ename}: {error.evalue[:LONGEST]}"
    except CellTimeoutError:
        return f"Cell {reached} was stopped: the notebook may take {timeout:g} s."
    except DeadKernelError:
        return f"The kernel died in cell {reached}; did it need more memory than there is?"
    return ""


if __name__ == "__main__":
    main()
