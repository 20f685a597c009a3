"""Expanding a document in front of a user."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.model.document import Document
from robovast.model.expansion import Variant, expand
from robovast_cli.ui.progress_line import progress_line


def _variants(document: Document, folder: Path, show: Callable[[str], None]) -> list[Variant]:
    """The variants of a document; of a search, those of its first batch."""
    if document.vast.search is None:
        return expand(document, folder, show)
    from robovast.search.proposing import first_batch

    return list(first_batch(document, folder, show).variants)


@contextmanager
def expanded_variants(document: Document) -> Iterator[list[Variant]]:
    """The variants of a document; their files are there while the context lasts."""
    with TemporaryDirectory(prefix="robovast-") as folder:
        with progress_line(f"Expanding {document.source.file.name}") as show:
            variants = _variants(document, Path(folder), show)
        yield variants
