"""`vast evaluation notebook`: a notebook on results, in Jupyter."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Annotated

import typer

from robovast.base.errors import ExitCode
from robovast.base.file_errors import read_content
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo

PROGRAMS = ("jupyter-lab", "jupyter-notebook")


@examples(
    ("vast evaluation notebook results/hall-2026-03-04-152130", "Analyze a campaign"),
    ("vast evaluation notebook results/hall-2026-03-04-152130 paths", "Open the notebook `paths`"),
)
def notebook(
    path: Annotated[
        Path,
        typer.Argument(metavar="FOLDER", help="Folder of a campaign, a configuration or a run."),
    ],
    workload: Annotated[
        str | None,
        typer.Argument(
            metavar="WORKLOAD",
            help="Name in `evaluation.visualization`, required if there are several.",
        ),
    ] = None,
    batch: Annotated[
        int | None,
        typer.Option(
            "--batch",
            metavar="N",
            min=0,
            help="For a search: open the notebook for batch N, with `BATCH` set to N.",
        ),
    ] = None,
    override: Annotated[
        Path | None,
        typer.Option(
            "--override",
            metavar="VAST_FILE",
            help="Use the notebook of this .vast file (default: the campaign's own).",
        ),
    ] = None,
) -> int:
    """Open a notebook on results in Jupyter.

    Copies the notebook into the current folder, unless the copy exists, and sets `DATA_DIR` to
    the folder of results. Opens the copy with JupyterLab or Jupyter Notebook, without running it.
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
        echo(f"{copy} exists already and is not modified.")
    else:
        import nbformat

        content = read_notebook(read_content(original), target.folder, batch)
        copy.write_text(nbformat.writes(content), encoding="utf-8")
        echo(f"Wrote {copy}.")
    return _open(copy, original.parent)


def _open(copy: Path, modules: Path) -> int:
    """Open a notebook, whose kernel finds the modules next to the original."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        echo("Jupyter is not installed. Open the file in your editor, or: pip install jupyterlab")
        return ExitCode.OK
    path = os.pathsep.join(filter(None, (str(modules), os.environ.get("PYTHONPATH"))))
    return subprocess.run([program, copy], env={**os.environ, "PYTHONPATH": path}).returncode
