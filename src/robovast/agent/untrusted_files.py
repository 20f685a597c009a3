"""Stores folders that somebody else wrote: follows no link, and reads only regular files.

Files that cannot be read are reported one by one, and do not hinder the others.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import BoundedSemaphore
from typing import BinaryIO, TypeVar

from robovast.agent.bucket import Bucket
from robovast.base.errors import StorageError
from robovast.base.safe_paths import refuse_holes
from robovast.campaign.layout import TEST_RESULT
from robovast.campaign.run_files import ROOM, Missing, escaped, room_of

T = TypeVar("T")

SIDE_BY_SIDE = 8
"""How many files are stored at once, and how many connections that takes."""
DEEPEST = 200
"""Most levels of folders that are read; each takes an open file."""
LINK = "it is a link, which is not followed"
"""Why a link is not stored."""

_FILE = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY | os.O_CLOEXEC


def open_files(root: Path) -> Iterator[tuple[str, BinaryIO | OSError]]:
    """Path relative to `root` of everything below it that is no folder, and its content.

    In place of content that cannot be had, and of links, sockets and the like, there is an error.
    Files of our own user are read whatever their mode.
    """
    parent = os.open(root.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        folder = _open(parent, root.name, _FOLDER)
    except (FileNotFoundError, NotADirectoryError):
        return
    finally:
        os.close(parent)
    yield from _below(folder, "", DEEPEST)


def _below(folder: int, prefix: str, levels: int) -> Iterator[tuple[str, BinaryIO | OSError]]:
    """Files in an open folder, which is closed at the end."""
    try:
        names = sorted(os.listdir(folder), key=lambda name: (name != TEST_RESULT, name))
        # Files come before folders: where there is no room for all, these are the ones to have.
        for wanted in (False, True):
            for name in names:
                if _is_folder(folder, name) is wanted:
                    yield from _found(folder, name, prefix + name, levels)
    except OSError as error:
        yield prefix, error
    finally:
        os.close(folder)


def _is_folder(folder: int, name: str) -> bool:
    try:
        return stat.S_ISDIR(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode)
    except OSError:  # told when it is opened
        return False


def _found(
    folder: int, name: str, path: str, levels: int
) -> Iterator[tuple[str, BinaryIO | OSError]]:
    try:
        opened = _opened(folder, name, levels)
    except OSError as error:
        yield path, error
        return
    if isinstance(opened, int):
        yield from _below(opened, f"{path}/", levels - 1)
    else:
        yield path, opened


def _opened(folder: int, name: str, levels: int) -> BinaryIO | int:
    """Open a file, or a folder as a descriptor."""
    kind = os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode
    if stat.S_ISDIR(kind):
        if not levels:
            raise OSError(errno.ENAMETOOLONG, f"it is more than {DEEPEST} folders deep")
        return _open(folder, name, _FOLDER)
    _refuse_others(kind)
    file = os.fdopen(_open(folder, name, _FILE), "rb", buffering=0)
    try:
        _refuse_others(os.fstat(file.fileno()).st_mode)
        refuse_holes(file)
    except OSError:
        file.close()
        raise
    return file


def _refuse_others(kind: int) -> None:
    if stat.S_ISLNK(kind):
        raise OSError(errno.ELOOP, LINK)
    if not stat.S_ISREG(kind):
        raise OSError(errno.EINVAL, "it is not a regular file")


def _open(folder: int, name: str, flags: int) -> int:
    try:
        return os.open(name, flags, dir_fd=folder)
    except PermissionError:
        _make_readable(folder, name)
        return os.open(name, flags, dir_fd=folder)


def _make_readable(folder: int, name: str) -> None:
    """Make a file readable for its owner, since only its mode may prevent reading."""
    handle = os.open(name, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
    try:
        os.chmod(f"/proc/self/fd/{handle}", os.fstat(handle).st_mode & 0o777 | 0o500)
    finally:
        os.close(handle)


def store_files(root: Path, store: Callable[[str, int, BinaryIO], T]) -> tuple[list[T], Missing]:
    """Apply a function to every file below a folder, some at a time.

    Args:
        root: the folder; nothing happens when it does not exist.
        store: is given path, number and content of a file.

    Returns:
        What `store` returned, in no order, and the files that could not be read, or have no room
        in a list.
    """
    stored: list[T] = []
    missing = Missing()
    room = ROOM

    def keep(path: str, number: int, file: BinaryIO) -> None:
        with file:
            try:
                stored.append(store(path, number, file))
            except OSError as error:
                missing.add(path, error.strerror or str(error))

    with _Crowd() as crowd:
        for number, (path, found) in enumerate(open_files(root)):
            if isinstance(found, OSError):
                missing.add(path, found.strerror or str(found))
            elif (room := room - room_of(path)) < 0:
                found.close()
                missing.add_beyond()
            else:
                crowd.do(partial(keep, path, number, found), found)
    return stored, missing


def store_own_tree(
    bucket: Bucket,
    root: Path,
    *,
    there: Collection[str] = (),
    skipped: Collection[str] = (),
) -> set[str]:
    """Store every file below a folder that RoboVAST wrote under its path; returns the keys.

    Every file must be readable; links are refused.

    Args:
        bucket: the campaign's.
        root: the folder; nothing happens when it does not exist.
        there: keys that exist already.
        skipped: paths, relative to the folder, that are left out.

    Raises:
        StorageError: a file cannot be read, the server refuses, or is gone for too long.
    """

    def store(path: str, _: int, file: BinaryIO) -> str:
        key = escaped(path)
        if path in skipped:
            return ""
        if key in there:
            bucket.store.put(bucket.name, key, file)
        else:
            bucket.store.put_new(bucket.name, key, file)
        return key

    keys, missing = store_files(root, store)
    for file in missing.named():
        if file.reason != LINK:
            raise StorageError(f"{root / file.path}: cannot be stored: {file.reason}.")
    return set(keys) - {""}


class _Crowd:
    """A pool of threads with a bounded queue."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(SIDE_BY_SIDE)
        self._free = BoundedSemaphore(SIDE_BY_SIDE)
        self._failures: list[BaseException] = []

    def __enter__(self) -> _Crowd:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._pool.shutdown()
        if kind is None and self._failures:
            raise self._failures[0]

    def do(self, action: Callable[[], None], file: BinaryIO) -> None:
        """Schedule an action on a file; raise the exception of an earlier one."""
        self._free.acquire()
        if self._failures:
            file.close()
            raise self._failures[0]
        self._pool.submit(action).add_done_callback(self._ended)

    def _ended(self, future: Future[None]) -> None:
        failure = future.exception()
        if failure is not None:
            self._failures.append(failure)
        self._free.release()
