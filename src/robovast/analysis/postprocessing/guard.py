"""Refuses writes of plugins outside their campaign.

It intercepts Python's audit events for opening, renaming and removing files; programs that a plugin
starts are not restricted.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_PATHS: dict[str, tuple[tuple[int, int], ...]] = {
    "os.rename": ((0, 2), (1, 3)),
    "os.link": ((1, 3),),
    "os.symlink": ((1, 2),),
    "os.remove": ((0, 1),),
    "os.rmdir": ((0, 1),),
    "os.mkdir": ((0, 2),),
    "os.truncate": ((0, 1),),
}
"""Events that change folders: positions of the path arguments, and of the open folders that the
paths are relative to."""


class WriteGuard:
    """Restricts what the current plugin of this process may write."""

    def __init__(self) -> None:
        self._results: str | None = None
        self._allowed: tuple[str, ...] = ()
        self._elsewhere = (os.path.realpath(tempfile.gettempdir()), "/dev", "/proc")
        self.refused: str | None = None
        """The first path that was refused since `allow`."""

    def install(self) -> None:
        """Install the audit hook for the rest of the process."""
        sys.addaudithook(self._hear)

    def allow(self, campaign: Path, folders: Iterable[Path]) -> None:
        """Allow writes to a campaign, its siblings in the results folder, and other folders."""
        self.refused = None
        self._results = os.path.realpath(campaign.parent)
        own = (campaign, *folders, *_caches())
        self._allowed = tuple(os.path.realpath(path) for path in own)

    def allow_all(self) -> None:
        """Allow writes anywhere."""
        self._results = None

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self._results is None:
            return
        for path in _written(event, arguments):
            if not self._may(path):
                self.refused = self.refused or path
                raise PermissionError(f"{path} is outside of the campaign")

    def _may(self, path: str) -> bool:
        real = os.path.realpath(path)
        if _below(real, self._allowed) or "__pycache__" in real:
            return True
        if _below(real, (str(self._results),)):
            return os.path.dirname(real) == self._results and not os.path.isdir(real)
        return _below(real, self._elsewhere)


def _written(event: str, arguments: tuple[Any, ...]) -> Iterator[str]:
    """Paths that an event is about to change."""
    if event == "open":
        path, mode, flags = arguments
        by_mode = isinstance(mode, str) and not set(mode).isdisjoint("wax+")
        if by_mode or (isinstance(flags, int) and flags & _WRITING):
            yield from _path(path, -1)
    for place, folder in _PATHS.get(event, ()):
        opened = arguments[folder] if folder < len(arguments) else -1
        for path in _path(arguments[place], opened):
            if event != "os.mkdir" or not os.path.isdir(path):
                yield path


def _path(path: Any, folder: Any) -> Iterator[str]:
    """A path as text; file descriptors were checked when they were opened."""
    if isinstance(path, str | bytes | os.PathLike):
        base = os.readlink(f"/proc/self/fd/{folder}") if folder not in (-1, None) else ""
        yield os.path.join(base, os.fsdecode(path))


def _below(path: str, folders: Iterable[str]) -> bool:
    return any(path == folder or path.startswith(folder + os.sep) for folder in folders)


def _caches() -> Iterator[Path]:
    """Cache folders of libraries."""
    home = Path.home()
    yield Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    yield Path(os.environ.get("MPLCONFIGDIR") or home / ".config" / "matplotlib")
