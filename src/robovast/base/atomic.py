"""Atomic writes: a file with its final name is complete, even after a power cut.

Content is synced to the disk before the rename, and the rename before success is reported.
Unfinished files and folders have hidden names beside their targets that end in `.part`. A folder
is locked while it is written, so that leftovers of killed programs are recognized and removed.
"""

from __future__ import annotations

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
from robovast.base.file_errors import cause, writing
from robovast.base.safe_paths import create_file

_PART = re.compile(r"\..+\.[0-9]+(-[0-9a-f]{8})?\.part", re.DOTALL)
_REPLACED = re.compile(r"\..+\.replaced", re.DOTALL)
_FEW = 500
"""Up to this number, files are synced one by one; for more, the whole file system is synced."""
_LONGEST = 200
"""Longest part of a name that is kept in its part's name [byte]; file systems allow 255."""
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_CANNOT_EXCHANGE = {errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM}


def write_atomically(path: Path, text: str | bytes, *, lasting: bool = True) -> None:
    """Write a file so that readers, and crashes, see either the old or the new content.

    Args:
        path: the file.
        text: its content.
        lasting: sync it to the disk. Otherwise a power cut can leave it empty, which is acceptable
            for many files that can be made again.
    """
    with _part_of(path) as part:
        with create_file(part) as file:
            file.write(text.encode() if isinstance(text, str) else text)
        put_in_place(part, path, lasting=lasting)


def write_report(path: Path, text: str | bytes) -> None:
    """Write a file that a user has named; what a link leads to is replaced, not the link.

    Raises:
        StorageError: it cannot be written, or something else than a file is there.
    """
    with writing(path):
        target = path.resolve() if path.is_symlink() else path
        if os.path.lexists(target) and not target.is_file():
            raise StorageError(f"{path}: is a folder, device or pipe", hint="name a file")
        write_atomically(target, text, lasting=False)


@contextmanager
def appearing_file(target: Path) -> Iterator[Path]:
    """Path of a new file to write; it replaces the target when the context ends without error.

    If the new file is removed, the target is not changed.

    Raises:
        StorageError: the file cannot be written.
    """
    with storage_errors(target):
        make_folder(target.parent)
        with _part_of(target) as part:
            yield part
            if part.exists():
                put_in_place(part, target)


@contextmanager
def appearing_folder(target: Path) -> Iterator[Path]:
    """A new folder to fill; it gets its name when the context ends without error.

    Errors, including Ctrl-C and a full disk, leave nothing behind; leftovers of a killed program
    are removed by the next program that writes to the same parent.

    Args:
        target: final path of the folder.

    Raises:
        StorageError: the target exists, or the folder cannot be written.
    """
    with storage_errors(target):
        _refuse_taken(target, replace=False)
        with scratch_folder(target) as part:
            yield part
            put_in_place(part, target)


@contextmanager
def scratch_folder(target: Path) -> Iterator[Path]:
    """A temporary folder beside a target; removed at the end."""
    make_folder(target.parent)
    sweep(target.parent)
    part, lock = _claimed_part(target)
    try:
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)
        os.close(lock)


def part_name(target: Path) -> Path:
    """Temporary path of a file or folder that will replace its target."""
    name = os.fsdecode(os.fsencode(target.name)[:_LONGEST])
    return target.with_name(f".{name}.{os.getpid()}-{secrets.token_hex(4)}.part")


def put_in_place(
    source: Path, target: Path, *, replace: bool = False, lasting: bool = True
) -> None:
    """Rename a complete file or folder to its final name, durably.

    At every moment the target is either the old or the new one. On file systems that cannot
    exchange two folders (NFS), a replaced folder is briefly called `.NAME.replaced`: after a crash,
    the next program that writes the same target restores it.

    Args:
        source: path on the same file system; it no longer exists afterwards.
        target: the final path.
        replace: replace an existing folder; files are always replaced.
        lasting: see `write_atomically`; folders are always synced.

    Raises:
        StorageError: a folder exists and must not be replaced.
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
    """Remove a folder; its name disappears immediately."""
    part = part_name(folder)
    folder.rename(part)
    _remove(part)


def is_unfinished(name: str) -> bool:
    """Whether a name belongs to something that is being written, removed or replaced."""
    return _PART.fullmatch(name) is not None or _REPLACED.fullmatch(name) is not None


def sweep(folder: Path) -> None:
    """Remove folders that killed programs were writing or removing here."""
    for path in folder.iterdir():
        if _PART.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
            with suppress(OSError), _opened(path) as lock:  # locked: still being written
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)


def make_folder(folder: Path) -> None:
    """Create a folder and its parents, durably."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    try:
        folder.mkdir()
    except FileExistsError:  # another program created it meanwhile, unless it is a file
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), folder) from None
    sync_folder(folder.parent)


def sync_tree(folder: Path) -> None:
    """Sync everything in a folder to the disk; links are not followed."""
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
    except (PermissionError, RecursionError):  # another user's, or too deep
        left = -1
    if left < 0:
        os.sync()


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to the disk."""
    try:
        _sync(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some network file systems do not support it
            raise


@contextmanager
def storage_errors(target: Path) -> Iterator[None]:
    """Convert an error of the file system to a `StorageError`."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{target}: cannot be written: {cause(error)}. Nothing was left behind."
        ) from error


def _refuse_taken(target: Path, *, replace: bool) -> None:
    _restore(target)
    if os.path.lexists(target) and not replace and (not target.is_dir() or any(target.iterdir())):
        raise StorageError(
            f"{target} exists already; nothing was written.",
            hint="remove or rename it, or choose another name",
        )


@contextmanager
def _part_of(target: Path) -> Iterator[Path]:
    part = part_name(target)
    try:
        yield part
    finally:
        part.unlink(missing_ok=True)


def _claimed_part(target: Path) -> tuple[Path, int]:
    """Create a part's folder and lock it."""
    while True:
        part = part_name(target)
        part.mkdir()
        try:
            lock = os.open(part, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:  # swept before it was locked
            continue
        with suppress(OSError):  # NFS cannot lock folders, so they are never swept
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
    """Exchange two paths atomically."""
    import ctypes  # whose import costs more than all else of this module

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
    """Restore a folder that a killed program was about to replace."""
    old = _replaced_name(target)
    if not os.path.lexists(old):
        return
    if os.path.lexists(target):
        _remove(old)
    else:
        old.rename(target)


def _remove(path: Path) -> None:
    """Remove an unnamed folder; if that fails, it does no harm."""
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
