"""What a file system refuses, in the words of RoboVAST."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robovast.base.errors import InputError, StorageError, with_hint
from robovast.base.safe_paths import read_file

LARGEST = 64 << 20
"""Largest file of a user that is read by default [bytes]."""
_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
_WORDS = {
    errno.EISDIR: "it is a folder",
    errno.ENOTDIR: "a part of its path is not a folder",
    errno.ELOOP: "a link in its path leads back to itself, or is not followed",
    errno.ENAMETOOLONG: "a name is too long",
    errno.ENXIO: "it is a device or pipe without anything behind it",
    **dict.fromkeys(_FULL, "the disk is full"),
}
"""Causes that the system names in words of programmers."""
_REFUSALS = frozenset(
    {
        *_FULL,
        *(errno.EACCES, errno.EPERM, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE),
        *(errno.ELOOP, errno.ENAMETOOLONG),  # of links that came from elsewhere
    }
)


def is_refusal(error: OSError) -> bool:
    """True for what a machine refuses whoever asks; the rest a program should have expected."""
    return error.errno in _REFUSALS


def sentence(error: OSError) -> str:
    """What a machine refuses, where that is known, and the remedy."""
    return with_hint(*refusal(error))


def refusal(error: OSError) -> tuple[str, str]:
    """What a machine refuses, where that is known, and the remedy, which may be empty."""
    place = f"{error.filename}: " if error.filename else ""
    remedy = "free some space, then repeat the command" if error.errno in _FULL else ""
    return f"{place}{cause(error)}.", remedy


def cause(error: OSError) -> str:
    """Why a file cannot be read or written."""
    if isinstance(error, shutil.Error):  # of copying a tree: one entry for each file
        source, _, first = error.args[0][0]
        return f"{first} ({source})"
    return _WORDS.get(error.errno or 0) or error.strerror or str(error)


def refuse_obstacle(folder: Path) -> None:
    """Raise a StorageError if something else is in the place of a folder, or of its parents."""
    found = obstacle(folder)
    if found:
        raise StorageError(f"{found}, and results go into a folder", hint="choose another place")


def obstacle(folder: Path) -> str:
    """What is in the place of a folder, or of one of its parents, and is none; empty if nothing."""
    for path in (folder, *folder.parents):
        try:
            mode = path.stat().st_mode
        except OSError as error:
            if os.path.islink(path):
                return f"{path} is a link to `{os.readlink(path)}`, which leads nowhere"
            if error.errno not in {errno.ENOENT, errno.ENOTDIR}:
                return f"{path} cannot be used ({cause(error)})"
        else:
            kind = "a file" if stat.S_ISREG(mode) else "a device or a pipe"
            return "" if stat.S_ISDIR(mode) else f"{path} is {kind}"
    return ""


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


def read_content(path: Path, most: int = LARGEST) -> bytes:
    """Read a regular file that the user named, through links; see `safe_paths.read_file`.

    Raises:
        InputError: the file cannot be read, or has more than `most` bytes.
    """
    try:
        with reading(path):
            return read_file(Path(os.path.realpath(path)), most=most)
    except ValueError:  # a NUL, or half of a surrogate pair
        raise InputError(
            f"no file can be called {str(path)!r}", hint="choose another name"
        ) from None


def read_text(path: Path) -> str:
    """Read a text file that the user named, such as a .vast file, in UTF-8.

    Raises:
        InputError: the file cannot be read, has more than 64 MiB, or is not a text file.
    """
    try:
        return read_content(path).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not a text file in UTF-8 (byte {error.start})",
            hint="check that it is the right file",
        ) from None


@contextmanager
def reading(path: Path | str) -> Iterator[None]:
    """Say which file cannot be read, and why.

    Raises:
        InputError: in place of an OSError.
    """
    try:
        yield
    except FileNotFoundError:
        if os.path.islink(path):
            target = os.readlink(path)
            raise InputError(
                f"{path}: is a link to `{target}`, which does not exist.",
                hint="correct or remove the link",
            ) from None
        raise InputError(f"{path}: there is no such file", hint="check the path") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {cause(error)}.") from None
