"""Atomic writes: a file that has its name is whole, and stays whole when the power goes.

Content is on the disk before it gets its name, and the name is on the disk before anybody is told.
What is being written has a hidden name beside its target, which ends in `.part`. Who writes a
folder holds a lock on it, so that what a killed program left can be told, and removed.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robovast.base.errors import StorageError
from robovast.base.file_errors import cause
from robovast.base.safe_paths import create_file

_PART = re.compile(r"\..+\.[0-9]+(-[0-9a-f]{8})?\.part", re.DOTALL)
_REPLACED = re.compile(r"\..+\.replaced", re.DOTALL)
_FEW = 500
"""So many files are brought to the disk one by one; of more, all that the machine has written."""
_LONGEST = 200
"""How much of a name stands in its part's [byte]; a file system takes 255."""
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_CANNOT_EXCHANGE = {errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM}


def write_atomically(path: Path, text: str, *, lasting: bool = True) -> None:
    """Write a file so that a reader, or a crash, sees the old content or the new, never half.

    Args:
        path: the file.
        text: its content.
        lasting: wait until it is on the disk; without, a power cut can leave it empty, which is
            for what can be made again, many thousand files at a time.
    """
    with _part_of(path) as part:
        with create_file(part) as file:
            file.write(text.encode())
        put_in_place(part, path, lasting=lasting)


@contextmanager
def appearing_file(target: Path) -> Iterator[Path]:
    """Path of a new file to write; it takes the target's place when the context ends well.

    Who removes it leaves the target as it was.

    Raises:
        StorageError: it cannot be written.
    """
    with explained(target):
        make_folder(target.parent)
        with _part_of(target) as part:
            yield part
            if part.exists():
                put_in_place(part, target)


@contextmanager
def appearing_folder(target: Path, *, replace: bool = False) -> Iterator[Path]:
    """A new folder to fill; it gets its name when the context ends without an error.

    Whatever ends the context early, Ctrl-C and a full disk included, leaves nothing behind; what a
    killed program leaves is removed by the next one that writes there.

    Args:
        target: the folder's place.
        replace: take the place of a folder that is there, at the very end.

    Raises:
        StorageError: the place is taken, or the folder cannot be written.
    """
    with explained(target):
        _refuse_taken(target, replace=replace)
        with scratch_folder(target) as part:
            yield part
            put_in_place(part, target, replace=replace)


@contextmanager
def scratch_folder(target: Path) -> Iterator[Path]:
    """A new folder beside a target, for what is to be put in its place; gone at the end."""
    make_folder(target.parent)
    sweep(target.parent)
    part, lock = _claimed_part(target)
    try:
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)
        os.close(lock)


def part_name(target: Path) -> Path:
    """Where a file or folder can be written before it takes its target's place."""
    name = os.fsdecode(os.fsencode(target.name)[:_LONGEST])
    return target.with_name(f".{name}.{os.getpid()}-{secrets.token_hex(4)}.part")


def put_in_place(
    source: Path, target: Path, *, replace: bool = False, lasting: bool = True
) -> None:
    """Give a complete file or folder its name, for good; what it replaces goes last.

    At every instant the target is the old or the new. On file systems that cannot exchange two
    folders (NFS) a replaced folder is for an instant `.NAME.replaced`: a killed program can leave
    it so, and whoever writes the same target next puts it back.

    Args:
        source: on the same file system; no longer there afterwards.
        target: its place.
        replace: take the place of a folder that is there; a file always does.
        lasting: as for `write_atomically`; a folder always is.

    Raises:
        StorageError: a folder is there and shall not be replaced.
    """
    is_folder = source.is_dir() and not source.is_symlink()
    if is_folder:
        _refuse_taken(target, replace=replace)
        sync_tree(source)
    elif lasting:
        _sync(source, os.O_RDONLY)
    make_folder(target.parent)
    if is_folder and os.path.lexists(target):
        _replace_folder(source, target)
    else:
        os.replace(source, target)
        if lasting:
            sync_folder(target.parent)


def discard(folder: Path) -> None:
    """Remove a folder; by its name it is gone at once."""
    part = part_name(folder)
    folder.rename(part)
    _remove(part)


def is_unfinished(name: str) -> bool:
    """True for the name of what is being written, removed or replaced."""
    return _PART.fullmatch(name) is not None or _REPLACED.fullmatch(name) is not None


def sweep(folder: Path) -> None:
    """Remove folders that programs were writing here, or removing, when they were killed."""
    for path in folder.iterdir():
        if _PART.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
            with suppress(OSError), _opened(path) as lock:  # whoever holds it still writes
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)


def refuse_file(folder: Path) -> None:
    """Raise a StorageError when a file stands where a folder is to be, or one above it."""
    file = next((path for path in (folder, *folder.parents) if path.is_file()), None)
    if file is not None:
        raise StorageError(f"{file} is a file, and results go into a folder. Choose another place.")


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, for good."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    try:
        folder.mkdir()
    except FileExistsError:  # another program made it meanwhile, unless it is a file
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), folder) from None
    sync_folder(folder.parent)


def sync_tree(folder: Path) -> None:
    """Bring everything in a folder to the disk; no link is followed."""
    left = _FEW
    try:
        for _, _, names, descriptor in os.fwalk(folder, onerror=_raise):
            left -= len(names) + 1
            if left < 0:
                break
            for name in names:
                if stat.S_ISREG(os.lstat(name, dir_fd=descriptor).st_mode):
                    _sync(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, descriptor)
            os.fsync(descriptor)
    except (PermissionError, RecursionError):  # another user's, or too deep to walk through
        left = -1
    if left < 0:
        os.sync()


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk."""
    try:
        _sync(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        if error.errno != errno.EINVAL:  # what some network file systems say, which keep names
            raise


@contextmanager
def explained(target: Path) -> Iterator[None]:
    """Turn a fault of the file system into a `StorageError`."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{target}: cannot be written: {cause(error)}. Nothing was left behind."
        ) from error


def _refuse_taken(target: Path, *, replace: bool) -> None:
    _restore(target)
    if os.path.lexists(target) and not replace and (not target.is_dir() or any(target.iterdir())):
        raise StorageError(f"{target} exists already; nothing was written.")


@contextmanager
def _part_of(target: Path) -> Iterator[Path]:
    part = part_name(target)
    try:
        yield part
    finally:
        part.unlink(missing_ok=True)


def _claimed_part(target: Path) -> tuple[Path, int]:
    """A new part's folder, and the lock on it."""
    while True:
        part = part_name(target)
        part.mkdir()
        try:
            lock = os.open(part, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:  # swept between the two
            continue
        with suppress(OSError):  # NFS locks no folder, and so lets nobody sweep it either
            fcntl.flock(lock, fcntl.LOCK_EX)
        if part.is_dir():
            return part, lock
        os.close(lock)


def _replace_folder(source: Path, target: Path) -> None:
    try:
        _exchange(source, target)
    except OSError as error:
        if error.errno not in _CANNOT_EXCHANGE:
            raise
        _exchange_by_renaming(source, target)
    sync_folder(target.parent)
    sync_folder(source.parent)
    _remove(source)


def _exchange(one: Path, other: Path) -> None:
    """Let two paths change places, at one instant."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    names = (os.fsencode(one), os.fsencode(other))
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code), str(one), None, str(other))


def _exchange_by_renaming(source: Path, target: Path) -> None:
    old = _replaced_name(target)
    target.rename(old)
    try:
        source.rename(target)
    except BaseException:
        old.rename(target)
        raise
    old.rename(source)


def _replaced_name(target: Path) -> Path:
    return target.with_name(f".{os.fsdecode(os.fsencode(target.name)[:_LONGEST])}.replaced")


def _restore(target: Path) -> None:
    """Put back what was about to be replaced when the program was killed."""
    old = _replaced_name(target)
    if not os.path.lexists(old):
        return
    if os.path.lexists(target):
        _remove(old)
    else:
        old.rename(target)


def _remove(path: Path) -> None:
    """Remove what has lost its name; what cannot be removed harms nobody."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def _opened(path: Path | str, flags: int = os.O_RDONLY, folder: int | None = None) -> Iterator[int]:
    descriptor = os.open(path, flags, dir_fd=folder)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _sync(path: Path | str, flags: int, folder: int | None = None) -> None:
    with _opened(path, flags, folder) as descriptor:
        os.fsync(descriptor)


def _raise(error: OSError) -> None:
    raise error
