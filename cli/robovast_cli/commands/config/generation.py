"""`vast config generate`: writes a campaign as it is before its first run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import typer

from robovast.base.errors import StorageError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations
from robovast.model.document import Document
from robovast.model.expansion import compose
from robovast_cli.ui.working import working
from robovast_cli.workspace import shown


def generate(document: Document, out: Path, *, keep_work: bool, use_cache: bool) -> None:
    """Write `_config`, `_transient` and a folder for each configuration.

    Args:
        document: a checked document.
        out: new or empty folder; equal documents give equal files.
        keep_work: keep the folder that variation types work in.
        use_cache: False hides from variation types what they stored earlier.

    Raises:
        StorageError: the folder holds something, or cannot be written.
    """
    refuse_obstacle(out)
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise StorageError(
                f"cannot generate into {out}: the folder is not empty",
                hint="choose a new folder, or empty this one",
            )
        with _work_folder(out, keep_work) as work, _cache(use_cache):
            with working(f"Expanding {document.source.file.name}") as tell:
                composition = compose(document, work, tell)
            with working(f"Writing {len(composition.variants)} configurations") as tell:
                write_configurations(document, composition, out, timings=False, tell=tell)
    count = len(composition.variants)
    typer.echo(f"Wrote {count} configuration{'s' if count != 1 else ''} to {shown(out)}.")


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
    """Without the cache, a temporary one is used."""
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
