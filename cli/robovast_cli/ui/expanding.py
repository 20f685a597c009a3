"""Expanding a document in front of a user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.model.document import Document
from robovast.model.expansion import Variant, expand
from robovast_cli.ui.working import working


@contextmanager
def expanded(document: Document) -> Iterator[list[Variant]]:
    """The variants of a document; their files are there while the context lasts."""
    with TemporaryDirectory(prefix="robovast-") as folder:
        with working(f"Expanding {document.source.file.name}") as tell:
            variants = expand(document, Path(folder), tell)
        yield variants
