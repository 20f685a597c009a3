"""Reads settings (addresses and credentials) from the environment or a `.env` file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import StringIO
from pathlib import Path

from robovast.base.errors import InputError
from robovast.base.file_errors import read_text
from robovast.base.optional_deps import SHARE
from robovast.base.trusted_files import find_above

DOTENV = ".env"


def environment(folder: Path | None = None) -> Mapping[str, str]:
    """The environment, completed by a `.env` file at or above a folder.

    Args:
        folder: where to start the search; by default the working directory.

    Raises:
        InputError: the file cannot be read.
        CannotRunError: there is a file, but the package that reads it is missing.
    """
    return {**_dotenv(folder or Path.cwd()), **os.environ}


@contextmanager
def dotenv_loaded(folder: Path | None = None) -> Iterator[None]:
    """Add the variables of the `.env` file to this process's environment within the context."""
    added = {key: value for key, value in environment(folder).items() if key not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for key in added:
            os.environ.pop(key, None)


def _dotenv(folder: Path) -> dict[str, str]:
    path = find_above(folder, DOTENV)
    if path is None:
        return {}
    with SHARE.needed_by(f"Reading {path}"):
        from dotenv import dotenv_values
    text = read_text(path)
    if "\0" in text:
        raise InputError(
            f"{path}: contains a NUL character, which no variable can have.",
            hint="remove the character",
        )
    found = dotenv_values(stream=StringIO(text))
    return {key: value for key, value in found.items() if value is not None}
