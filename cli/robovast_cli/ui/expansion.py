"""Expand a `.vast` file and show the progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.model.document import Document
from robovast.model.expansion import Variant, expand
from robovast_cli.ui.progress_line import progress_line


def _variants(document: Document, folder: Path, show: Callable[[str], None]) -> list[Variant]:
    """Return the variants of a document, or of the first batch of a search."""
    if document.vast.search is None:
        return expand(document, folder, show)
    from robovast.search.proposing import first_batch

    return list(first_batch(document, folder, show).variants)


@contextmanager
def expanded_variants(document: Document) -> Iterator[list[Variant]]:
    """Yield the variants of a document, with temporary files."""
    with TemporaryDirectory(prefix="robovast-") as folder:
        with progress_line(f"Expanding {document.source.file.name}") as show:
            variants = _variants(document, Path(folder), show)
        yield variants
