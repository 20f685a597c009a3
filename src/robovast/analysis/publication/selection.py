"""Selects a campaign's files for an archive and determines their paths in it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import translate
from pathlib import Path, PurePosixPath


class Filter:
    """Glob patterns on paths relative to the campaign; `*` also matches `/`.

    A pattern without `/` is matched against the file's name, any other against its path.
    """

    def __init__(self, include: Sequence[str] | None, exclude: Sequence[str]) -> None:
        self._include = None if include is None else _Patterns(include)
        self._exclude = _Patterns(exclude)

    def takes(self, path: str) -> bool:
        """True if a file is included and not excluded."""
        included = self._include is None or self._include.match(path)
        return included and not self._exclude.match(path)


class _Patterns:
    def __init__(self, patterns: Iterable[str]) -> None:
        paths = [pattern.removeprefix("/") for pattern in patterns if "/" in pattern]
        names = [pattern for pattern in patterns if "/" not in pattern]
        self._path = re.compile("|".join(map(translate, paths)) or r"(?!)")
        self._name = re.compile("|".join(map(translate, names)) or r"(?!)")

    def match(self, path: str) -> bool:
        name = path.rpartition("/")[2]
        return bool(self._name.match(name) or self._path.match(path))


def files_of(campaign: Path) -> Iterator[tuple[str, Path]]:
    """Files and links of a campaign with their relative paths.

    Top-level names that begin with `.` are work in progress, not results; `.env` files contain
    credentials.
    """
    for root, folders, files in os.walk(campaign):
        here = Path(root)
        if here == campaign:
            folders[:] = [name for name in folders if not name.startswith(".")]
            files = [name for name in files if not name.startswith(".")]
        links = (name for name in folders if os.path.islink(here / name))
        for name in (*links, *files):
            path = here / name
            if name != ".env" and (os.path.islink(path) or os.path.isfile(path)):
                yield path.relative_to(campaign).as_posix(), path


def archive_path(path: str, *, omit_hidden: bool) -> str:
    """A file's path below the campaign's folder in the archive, always valid text.

    Args:
        path: relative to the campaign.
        omit_hidden: leave out folders whose names begin with `_`.
    """
    *folders, name = PurePosixPath(path).parts
    kept = [folder for folder in folders if not (omit_hidden and folder.startswith("_"))]
    return os.fsencode("/".join((*kept, name))).decode("utf-8", "backslashreplace")


def link_target(campaign: Path, path: str, link: Path, *, omit_hidden: bool) -> str | None:
    """Target of a link in the archive; None if it leaves the campaign or leads in a circle.

    Args:
        campaign: the campaign's folder.
        path: path of the link, relative to the campaign.
        link: the link.
        omit_hidden: as in `archive_path`.
    """
    root, end = Path(os.path.realpath(campaign)), Path(os.path.realpath(link))
    leads_in_circle = os.path.islink(end)
    if link.readlink().is_absolute() or leads_in_circle or not end.is_relative_to(root):
        return None
    inside = end.relative_to(root).as_posix()
    if omit_hidden:
        kept = [part for part in PurePosixPath(inside).parts if not part.startswith("_")]
        inside = "/".join(kept) or "."
    folder = PurePosixPath(archive_path(path, omit_hidden=omit_hidden)).parent
    return os.path.relpath(inside, folder)
