"""What a file system refuses, in the words of RoboVAST."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robovast.base.errors import InputError, StorageError

_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
_REFUSALS = _FULL | {errno.EACCES, errno.EPERM, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE}


def is_refusal(error: OSError) -> bool:
    """True for what a machine refuses whoever asks; the rest a program should have expected."""
    return error.errno in _REFUSALS


def sentence(error: OSError) -> str:
    """What a machine refuses, where that is known, and the remedy."""
    place = f"{error.filename}: " if error.filename else ""
    remedy = " Free some space, then repeat it." if error.errno in _FULL else ""
    return f"{place}{cause(error)}.{remedy}"


def cause(error: OSError) -> str:
    """Why a file cannot be read or written."""
    if error.errno in _FULL:
        return "the disk is full"
    if isinstance(error, shutil.Error):  # of copying a tree: one entry for each file
        source, _, first = error.args[0][0]
        return f"{first} ({source})"
    return error.strerror or str(error)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say which file cannot be written, and why.

    Args:
        path: what is written; files below it are named themselves.

    Raises:
        StorageError: in place of an OSError.
    """
    try:
        yield
    except OSError as error:
        name = error.filename or path
        raise StorageError(f"{name}: cannot be written: {cause(error)}.") from error


@contextmanager
def reading(path: Path | str) -> Iterator[None]:
    """Say which file cannot be read, and why.

    Raises:
        InputError: in place of an OSError.
    """
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {cause(error)}.") from None
