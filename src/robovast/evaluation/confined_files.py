"""Reads files strictly within a folder: neither `..` nor links lead out of it.

Paths are resolved first, so that links inside the folder work (such as a run's `job`). Then they
are opened part by part without following links, so that links created meanwhile have no effect.
"""

from __future__ import annotations

import os
import stat
from io import BufferedReader
from pathlib import Path

from robovast.base.errors import InputError
from robovast.base.safe_paths import read_at_most

_FLAGS = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class OutsideError(InputError):
    """A path leaves the folder."""


class MissingError(InputError):
    """A file or folder is missing."""


def resolved(root: Path, relative: str) -> Path:
    """Resolve a path below a folder; `root` itself must be free of links.

    Raises:
        OutsideError: the path leaves the folder.
        MissingError: nothing exists there.
    """
    if "\0" in relative:
        raise OutsideError(f"{relative!r} is not a valid path.")
    try:
        path = (root / relative).resolve(strict=True)
    except (FileNotFoundError, NotADirectoryError):
        raise MissingError(f"There is no {relative}.") from None
    except (OSError, RuntimeError, ValueError) as error:  # circular links, too long names
        raise OutsideError(f"{relative} cannot be resolved: {error}.") from None
    if not path.is_relative_to(root):
        raise OutsideError(f"{relative} leads out of the results folder.")
    return path


def open_inside(root: Path, relative: str) -> BufferedReader:
    """Open a regular file below a folder; see `resolved`."""
    path = resolved(root, relative)
    try:
        descriptor = _open(root, path.relative_to(root).parts)
    except OSError as error:
        raise MissingError(f"{relative} cannot be read: {error.strerror}.") from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise MissingError(f"{relative} is not a file.")
    return os.fdopen(descriptor, "rb")


def _open(root: Path, parts: tuple[str, ...]) -> int:
    descriptor = os.open(root, os.O_RDONLY | os.O_CLOEXEC | os.O_DIRECTORY)
    for part in parts:
        try:
            following = os.open(part, _FLAGS, dir_fd=descriptor)
        finally:
            os.close(descriptor)
        descriptor = following
    return descriptor


def read_small(root: Path, relative: str, limit: int = 1 << 20) -> bytes:
    """The content of a file below a folder.

    Raises:
        InputError: the file is larger than `limit` [bytes]; see also `resolved`.
    """
    with open_inside(root, relative) as file:
        content = read_at_most(file, limit + 1)
    if len(content) > limit:
        raise InputError(f"{relative} is larger than {limit} bytes.")
    return content
