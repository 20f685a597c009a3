"""`vast config generate`: write a campaign as it is before its first run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from robovast.base.errors import StorageError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations
from robovast.model.expansion import compose
from robovast_cli.lazy import examples
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown


@examples(
    ("vast config generate inputs", "Write all inputs to the folder inputs"),
    ("vast config generate inputs --no-cache", "Do not use cached files"),
)
def generate(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="New or empty folder.")],
    keep_transient: Annotated[
        bool,
        typer.Option(
            "--keep-transient",
            help="Keep intermediate files of the variation types in OUT/_transient/work.",
        ),
    ] = False,
    no_cache: Annotated[
        bool,
        typer.Option(
            "--no-cache",
            help="Use an empty cache ($XDG_CACHE_HOME is a new folder), so that variation types "
            "create all files again.",
        ),
    ] = False,
) -> None:
    """Generate all inputs of a campaign without running them."""
    document = ctx.obj.document()
    refuse_obstacle(out)
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise StorageError(
                f"cannot generate into {out}: the folder is not empty",
                hint="choose a new folder, or empty this one",
            )
        with _work_folder(out, keep_transient) as work, _cache(not no_cache):
            with progress_line(f"Expanding {document.source.file.name}") as show:
                composition = compose(document, work, show)
            with progress_line(f"Writing {len(composition.variants)} configurations") as show:
                write_configurations(document, composition, out, timings=False, tell=show)
    count = counted(len(composition.variants), "configuration")
    typer.echo(f"Wrote {count} to {shown(out)}.")


@contextlib.contextmanager
def _work_folder(out: Path, keep: bool) -> Iterator[Path]:
    if keep:
        work = Layout(out).transient / "work"
        work.mkdir(parents=True)
        yield work.absolute()
    else:
        with TemporaryDirectory(prefix="robovast-") as folder:
            yield Path(folder)


@contextlib.contextmanager
def _cache(use: bool) -> Iterator[None]:
    """Use an empty temporary cache unless `use` is true."""
    if use:
        yield
        return
    before = os.environ.get("XDG_CACHE_HOME")
    with TemporaryDirectory(prefix="robovast-cache-") as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            yield
        finally:
            os.environ.pop("XDG_CACHE_HOME")
            if before is not None:
                os.environ["XDG_CACHE_HOME"] = before
