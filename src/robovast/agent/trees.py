"""Storing folders that somebody else wrote: no link is followed, nothing but files is read."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import BoundedSemaphore
from typing import BinaryIO

from robovast.agent.bucket import Bucket

SIDE_BY_SIDE = 8
"""How many files are stored at once, and how many connections that takes."""


def open_files(root: Path) -> Iterator[tuple[str, BinaryIO]]:
    """Path relative to `root` and content of every regular file below it.

    What vanishes meanwhile, links, sockets and the like are passed over.
    """
    try:
        yield from _open_files(root)
    except FileNotFoundError:
        return


def _open_files(root: Path) -> Iterator[tuple[str, BinaryIO]]:
    for folder, _, names, folder_fd in os.fwalk(root):
        below = os.path.relpath(folder, root)
        for name in sorted(names):
            file = _open_regular(name, folder_fd)
            if file is not None:
                path = name if below == "." else f"{below}/{name}"
                yield os.fsencode(path).decode("utf-8", "replace"), file


def _open_regular(name: str, folder_fd: int) -> BinaryIO | None:
    try:
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        file = os.fdopen(os.open(name, flags, dir_fd=folder_fd), "rb")
    except OSError:
        return None
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    return None


def store_tree(
    bucket: Bucket,
    root: Path,
    prefix: str,
    *,
    there: Collection[str] = (),
    skipped: Collection[str] = (),
) -> set[str]:
    """Store every file below a folder; returns the keys.

    Args:
        bucket: the campaign's.
        root: the folder; nothing happens when it does not exist.
        prefix: begins every key.
        there: keys below the prefix that exist already.
        skipped: paths, relative to the folder, that are left out.

    Raises:
        StorageError: the server refuses, or is gone for too long.
    """

    def store(key: str, file: BinaryIO) -> None:
        with file:
            bucket.store.put(bucket.name, key, file, is_new=key not in there)

    keys: set[str] = set()
    with _Crowd() as crowd:
        for path, file in open_files(root):
            if path in skipped:
                file.close()
            else:
                key = prefix + path
                keys.add(key)
                crowd.do(partial(store, key, file))
    return keys


class _Crowd:
    """Threads that never have more to do than they can do at once."""

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

    def do(self, action: Callable[[], None]) -> None:
        """Do it soon; raises what an earlier action raised."""
        self._free.acquire()
        if self._failures:
            raise self._failures[0]
        self._pool.submit(action).add_done_callback(self._ended)

    def _ended(self, future: Future[None]) -> None:
        failure = future.exception()
        if failure is not None:
            self._failures.append(failure)
        self._free.release()
