"""Lists the files of a run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from robovast.evaluation.confined_files import MissingError, resolved

FileKind = Literal["table", "log", "text", "image", "video", "other"]

MOST_FILES = 2000

KINDS: dict[str, FileKind] = {
    ".csv": "table",
    ".log": "log",
    ".txt": "log",
    ".xml": "text",
    ".json": "text",
    ".yaml": "text",
    ".yml": "text",
    ".osc": "text",
    ".png": "image",
    ".jpg": "image",
    ".jpeg": "image",
    ".gif": "image",
    ".webp": "image",
    ".webm": "video",
    ".mp4": "video",
}


@dataclass(frozen=True, slots=True)
class FileEntry:
    """A file, as shown on the page."""

    path: str
    """Path relative to the results folder, with `/` as separator."""
    name: str
    """Path relative to the listed folder."""
    kind: FileKind
    size: int
    """[bytes]"""


def list_files(results: Path, relative: str) -> list[FileEntry]:
    """Regular files in a folder by name, at most `MOST_FILES`; links are left out.

    Raises:
        InputError: the folder is missing below `results`.
    """
    folder = resolved(results, relative)
    if not os.path.isdir(folder):
        raise MissingError(f"{relative} is not a folder.")
    entries = []
    for path, size in _walk(folder):
        name = _readable(path.relative_to(folder).as_posix())
        place = _readable(path.relative_to(results).as_posix())
        entries.append(FileEntry(place, name, kind_of(name), size))
        if len(entries) == MOST_FILES:
            break
    return sorted(entries, key=lambda entry: entry.name)


def kind_of(name: str) -> FileKind:
    """The kind of a file, by its suffix."""
    return KINDS.get(PurePosixPath(name).suffix.lower(), "other")


def _readable(name: str) -> str:
    """A printable form of a name that is not UTF-8."""
    return name.encode("utf-8", "replace").decode()


def _walk(folder: Path) -> Iterator[tuple[Path, int]]:
    for parent, folders, names in os.walk(folder):
        folders.sort()
        for name in names:
            path = Path(parent, name)
            if not os.path.islink(path) and os.path.isfile(path):
                yield path, path.stat().st_size
