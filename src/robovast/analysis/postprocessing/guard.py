"""Refuses a plugin's writes outside of its campaign.

It sees what Python code of the process opens, renames or removes, by its audit events; programs
that a plugin starts are not seen.
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
"""Events that change a folder: which of their arguments are the paths, and the open folders that
these are relative to."""


class Guard:
    """What the plugin in this process may write at the moment."""

    def __init__(self) -> None:
        self._results: str | None = None
        self._allowed: tuple[str, ...] = ()
        self._elsewhere = (os.path.realpath(tempfile.gettempdir()), "/dev", "/proc")
        self.refused: str | None = None
        """What was refused first since `allow`."""

    def install(self) -> None:
        """Watch this process from now on to its end."""
        sys.addaudithook(self._hear)

    def allow(self, campaign: Path, folders: Iterable[Path]) -> None:
        """Let what follows write to a campaign, beside it in the results folder, and to folders."""
        self.refused = None
        self._results = os.path.realpath(campaign.parent)
        own = (campaign, *folders, *_caches())
        self._allowed = tuple(os.path.realpath(path) for path in own)

    def allow_all(self) -> None:
        """Let what follows write anywhere."""
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
    """A path as text; what is opened already, and has a number, was looked at then."""
    if isinstance(path, str | bytes | os.PathLike):
        base = os.readlink(f"/proc/self/fd/{folder}") if folder not in (-1, None) else ""
        yield os.path.join(base, os.fsdecode(path))


def _below(path: str, folders: Iterable[str]) -> bool:
    return any(path == folder or path.startswith(folder + os.sep) for folder in folders)


def _caches() -> Iterator[Path]:
    """Where libraries keep what they may lose."""
    home = Path.home()
    yield Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    yield Path(os.environ.get("MPLCONFIGDIR") or home / ".config" / "matplotlib")
