"""Checks that a pod reads the same inputs with which its runs were planned."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from robovast.base.errors import InputError


def digest(content: bytes) -> str:
    """SHA-256 of a content."""
    return hashlib.sha256(content).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_files(wanted: Mapping[str, str], folder: Path) -> None:
    """Check that files are the same as when the runs were planned.

    Args:
        wanted: SHA-256 by path in the folder.
        folder: the folder.

    Raises:
        InputError: one of them is another, or missing.
    """
    for name, planned in wanted.items():
        path = folder / name
        check(name, file_digest(path) if path.is_file() else None, planned)


def check(name: str, found: str | None, planned: str) -> None:
    """Check that one input of the runs is as planned.

    Args:
        name: what it is.
        found: its SHA-256; None when it is missing.
        planned: what that should be.

    Raises:
        InputError: it is another.
    """
    if found != planned:
        change = "is missing" if found is None else "is another"
        raise InputError(
            f"{name}: {change}; the runs were planned with the one whose SHA-256 is {planned}. "
            "All runs of a campaign have one input",
            hint="put it back, or create another Campaign",
        )
