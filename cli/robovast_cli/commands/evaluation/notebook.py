"""`vast evaluation notebook`: a notebook of the results, in Jupyter."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Annotated

import typer

from robovast.base.errors import ExitCode
from robovast.base.file_errors import read_content
from robovast_cli.lazy import new_app
from robovast_cli.ui.output import say

app = new_app("Open a notebook on results in Jupyter.")

PROGRAMS = ("jupyter-lab", "jupyter-notebook")


@app.command()
def notebook(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="Folder of a campaign, of a configuration of it or of a run."
        ),
    ],
    workload: Annotated[
        str | None,
        typer.Argument(
            metavar="WORKLOAD",
            help="Name in `evaluation.visualization`; not needed when there is only one.",
            show_default=False,
        ),
    ] = None,
    batch: Annotated[
        int | None,
        typer.Option(
            "--batch",
            metavar="N",
            min=0,
            help="Of a search: the notebook for this batch, with `BATCH` set to its number.",
            show_default=False,
        ),
    ] = None,
    override: Annotated[
        Path | None,
        typer.Option(
            "--override",
            metavar="VAST_FILE",
            help="Take the notebook from this file, not from the campaign's own.",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Open a notebook in Jupyter, with `DATA_DIR` set to a folder of results.

    A copy of the notebook is written into the current folder, unless it is there already, and
    opened with JupyterLab or Jupyter Notebook, whichever is installed. Nothing is executed before
    you do so.
    """
    from robovast.base.optional_deps import NOTEBOOKS
    from robovast.evaluation.notebooks.data_dir import read_notebook
    from robovast.evaluation.notebooks.workloads import find_notebook, target_of

    NOTEBOOKS.require("A notebook")
    target = target_of(path, batch)
    original = find_notebook(target, workload, override).file()
    parts = [] if batch is None else [f"batch-{batch}"]
    copy = Path(f"{'-'.join((original.stem, *target.names, *parts))}.ipynb")
    if copy.exists():
        say(f"{copy} is there already; it is kept as it is.")
    else:
        import nbformat

        content = read_notebook(read_content(original), target.folder, batch)
        copy.write_text(nbformat.writes(content), encoding="utf-8")
        say(f"Wrote {copy}.")
    return _open(copy, original.parent)


def _open(copy: Path, modules: Path) -> int:
    """Open a notebook, whose kernel finds the modules beside the original."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        say("Jupyter is not installed; open the file with what you use: pip install jupyterlab.")
        return ExitCode.OK
    path = os.pathsep.join(filter(None, (str(modules), os.environ.get("PYTHONPATH"))))
    return subprocess.run([program, copy], env={**os.environ, "PYTHONPATH": path}).returncode
