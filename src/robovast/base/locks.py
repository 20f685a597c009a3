"""Exclusive access to folders, one program at a time."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from robovast.base.atomic import discard, sweep
from robovast.base.errors import StorageError

LOCK = "lock"
"""File in the folder that is locked while a program uses the folder."""
_PATIENCE = 0.5
"""How long a lock may be held by a program that only checks whether it is free [s]."""
_PAUSE = 0.02


@contextmanager
def exclusive_folder(folder: Path, refusal: str) -> Iterator[None]:
    """A work folder for this program alone; it is removed after success.

    It is removed while it is locked: a program that waits for the lock notices the removal and
    creates a new folder.

    Args:
        folder: created if missing; files of a previous program are kept.
        refusal: message if another program uses the folder.

    Raises:
        StorageError: another program uses the folder.
    """
    with _locked(folder, refusal):
        sweep(folder.parent)
        yield
        discard(folder)


def is_locked(folder: Path) -> bool:
    """Whether a program has a folder for itself."""
    try:
        lock = os.open(folder / LOCK, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


@contextmanager
def _locked(folder: Path, refusal: str) -> Iterator[None]:
    until = time.monotonic() + _PATIENCE
    folder.parent.mkdir(parents=True, exist_ok=True)
    while True:
        with suppress(FileExistsError):
            folder.mkdir()
        try:
            file = (folder / LOCK).open("w")
        except FileNotFoundError:  # removed after it was created
            continue
        with file:
            if _lock(file):
                if _is_still(file, folder / LOCK):
                    yield
                    return
            elif time.monotonic() > until:
                raise StorageError(refusal)
        time.sleep(_PAUSE)


def _lock(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_still(file: IO[str], path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
