"""SHA-256 of what a run has written, and verified copies of it."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator, Mapping
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

from robovast.base import safe_paths
from robovast.campaign.layout import OWN_NAMES
from robovast.campaign.object_keys import is_plain

MOST_FILES = 200
"""Most files of a run whose checksums its record has room for."""
MOST_NAMES = 32 << 10
"""Most characters of their paths together."""
_CHUNK = 1 << 20


class DifferentError(Exception):
    """A file is not what its checksum says."""


def checksums(folder: Path) -> dict[str, str] | None:
    """SHA-256 by path of all files that a run wrote.

    Args:
        folder: the run's.

    Returns:
        None if there is anything but plain files, a file that was never written as a whole, or
        too much for a record.
    """
    found: dict[str, str] = {}
    names = 0
    try:
        for path in _files(folder, folder):
            name = path.relative_to(folder).as_posix()
            names += len(name)
            if len(found) == MOST_FILES or names > MOST_NAMES:
                return None
            found[name] = checksum(path, folder)
    except OSError:
        return None
    return found


def recorded(sums: dict[str, str]) -> dict[str, str] | None:
    """Checksums, if a record has room for them."""
    fits = len(sums) <= MOST_FILES and sum(map(len, sums)) <= MOST_NAMES
    return sums if fits else None


def copy_verified(source: Path, target: Path, sums: Mapping[str, str]) -> None:
    """Copy a run's files to an empty folder: just those with checksums, and only as these say.

    Raises:
        DifferentError: a file is missing, cannot be read, or is not what it was.
        OSError: the copy cannot be written.
    """
    for name, expected in sums.items():
        if not is_plain(name) or name.partition("/")[0] in OWN_NAMES:
            raise DifferentError(f"`{name}` is not a valid path of an output file of a run")
        try:
            file = _open_whole(source / name, source.parent.parent)
        except OSError as error:
            raise DifferentError(f"`{name}` cannot be read: {error.strerror}") from None
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        with file, (target / name).open("xb") as copy:
            if _copy(file, copy) != expected:
                raise DifferentError(f"`{name}` has changed since the run")


def copy_files(source: Path, root: Path, target: Path) -> None:
    """Copy the plain files of a folder; links and anything else are left out.

    Args:
        source: the folder.
        root: ancestor below which no link is followed.
        target: an empty folder.
    """
    for path in _files(source, root, strict=False):
        safe_paths.copy(path, root, target / path.relative_to(source), target)


def _files(folder: Path, root: Path, *, strict: bool = True) -> Iterator[Path]:
    """All files in a folder, and in those below it, down to `DEEPEST`.

    Raises:
        OSError: there is anything else, and `strict`.
    """
    pending = [folder]
    lowest = len(folder.parts) + safe_paths.DEEPEST
    while pending:
        folder = pending.pop()
        if len(folder.parts) > lowest:
            if strict:
                raise OSError(f"{folder} is too deep")
            continue
        for name in safe_paths.names(folder, root):
            found = safe_paths.status(folder / name, root)
            mode = found.st_mode if found else 0
            if stat.S_ISDIR(mode):
                pending.append(folder / name)
            elif stat.S_ISREG(mode):
                yield folder / name
            elif strict:
                raise OSError(f"{folder / name} is not a file")


def checksum(path: Path, root: Path) -> str:
    """SHA-256 of a file.

    Raises:
        OSError: it cannot be read, or is no plain file that was written as a whole.
    """
    with _open_whole(path, root) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _open_whole(path: Path, root: Path) -> BufferedReader:
    """Open a file that is not sparse.

    Raises:
        OSError: it is, or it cannot be opened.
    """
    file = safe_paths.open_file(path, root)
    try:
        safe_paths.refuse_holes(file)
    except OSError:
        file.close()
        raise
    return file


def _copy(source: BinaryIO, target: BinaryIO) -> str:
    """Copy content, mode and time of a file; return its SHA-256."""
    digest = hashlib.sha256()
    while chunk := source.read(_CHUNK):
        digest.update(chunk)
        target.write(chunk)
    target.flush()
    found = os.fstat(source.fileno())
    os.fchmod(target.fileno(), stat.S_IMODE(found.st_mode) & 0o777)
    os.utime(target.fileno(), ns=(found.st_atime_ns, found.st_mtime_ns))
    return digest.hexdigest()
