"""Exclusive access to folders, one program at a time."""

from __future__ import annotations

import errno
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
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
_NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS})


@contextmanager
def exclusive_folder(folder: Path, refusal: str, hint: str = "") -> Iterator[None]:
    """A work folder for this program alone; it is removed after success.

    It is removed while it is locked: a program that waits for the lock notices the removal and
    creates a new folder.

    Args:
        folder: created if missing; files of a previous program are kept.
        refusal: message if another program uses the folder.
        hint: the hint of that message.

    Raises:
        StorageError: another program uses the folder.
    """
    with _locked(folder, StorageError(refusal, hint=hint)):
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
        return not lock_file(lock, folder, shared=True)
    finally:
        os.close(lock)


def lock_file(file: int, folder: Path, *, shared: bool = False, wait: bool = False) -> bool:
    """Lock an open file; return False if another program has locked it.

    Args:
        file: its descriptor.
        folder: the folder that the lock protects.
        shared: lock it against exclusive locks only.
        wait: wait until it is free.

    Raises:
        StorageError: the file system of the folder has no locks.
    """
    kind = (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB)
    try:
        fcntl.flock(file, kind)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        raise StorageError(
            f"{folder}: its file system has no file locks ({error.strerror}), so programs could "
            "overwrite each other's results",
            hint="use a folder on another file system, such as a local disk, or mount it with "
            "locks (NFS: the option `local_lock=flock`)",
        ) from None
    return True


@contextmanager
def _locked(folder: Path, refusal: StorageError) -> Iterator[None]:
    until = time.monotonic() + _PATIENCE
    folder.parent.mkdir(parents=True, exist_ok=True)
    while True:
        with suppress(FileExistsError):
            folder.mkdir()
        try:
            file = os.fdopen(os.open(folder / LOCK, _CREATE, 0o666), "w")
        except FileNotFoundError:  # removed after it was created
            continue
        with file:
            if lock_file(file.fileno(), folder):
                if _is_still(file, folder / LOCK):
                    yield
                    return
            elif time.monotonic() > until:
                raise refusal
        time.sleep(_PAUSE)


def _is_still(file: IO[str], path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
