"""Folders and files that appear at once and complete, or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robovast.errors import StorageError


@contextmanager
def appearing_folder(target: Path, *, replace: bool = False) -> Iterator[Path]:
    """A new folder to fill; it gets its name when the context ends without an error.

    Whatever ends the context early, Ctrl-C and a full disk included, leaves nothing behind.

    Args:
        target: the folder's place.
        replace: take the place of a folder that is there, at the very end.

    Raises:
        StorageError: the place is taken, or the folder cannot be written.
    """
    part = target.with_name(f".{target.name[:200]}.{os.getpid()}.part")
    with explained(target):
        refuse_taken(target, replace=replace)
        target.parent.mkdir(parents=True, exist_ok=True)
        part.mkdir()
        try:
            yield part
            take_place(part, target, replace=replace)
        finally:
            shutil.rmtree(part, ignore_errors=True)


@contextmanager
def appearing_file(target: Path) -> Iterator[Path]:
    """Path of a new file to write; it takes the target's place when the context ends well.

    Who removes it leaves the target as it was.

    Raises:
        StorageError: it cannot be written.
    """
    part = target.with_name(f".{target.name[:200]}.{os.getpid()}.part")
    with explained(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield part
            if part.exists():
                os.replace(part, target)
        finally:
            with suppress(OSError):
                part.unlink()


def refuse_taken(target: Path, *, replace: bool) -> None:
    """Accept a place for a folder when it is free or empty.

    Raises:
        StorageError: something is there and shall not be replaced.
    """
    if os.path.lexists(target) and not replace and (not target.is_dir() or any(target.iterdir())):
        raise StorageError(f"{target} exists already; nothing was written.")


def take_place(folder: Path, target: Path, *, replace: bool) -> None:
    """Rename a complete folder; what is replaced goes last."""
    refuse_taken(target, replace=replace)
    if not os.path.lexists(target):
        folder.rename(target)
        return
    old = folder.with_name(f".{target.name[:200]}.{os.getpid()}.old")
    target.rename(old)
    folder.rename(target)
    if old.is_dir() and not old.is_symlink():
        shutil.rmtree(old)
    else:
        old.unlink()


@contextmanager
def explained(target: Path) -> Iterator[None]:
    """Turn a fault of the file system into a `StorageError`."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{target}: cannot be written: {_cause(error)}. Nothing was left behind."
        ) from error


def _cause(error: OSError) -> str:
    if isinstance(error, shutil.Error):  # of copying a tree: one entry for each file
        source, _, cause = error.args[0][0]
        return f"{cause} ({source})"
    return error.strerror or str(error)
