"""Where the objects of a bucket have their place in a campaign's folder, and which have none.

A bucket takes any text as a key, and both `a` and `a/b`; whoever may write to it chooses them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from itertools import count
from pathlib import PurePosixPath

from robovast.base.atomic import is_unfinished
from robovast.base.printable import one_line
from robovast.campaign.layout import ASIDE, RUN_RECORD, RUNNING, STAGE

ORIGIN = ".bucket"
"""File in a campaign's folder of the page's mirror that names its bucket."""

_OWN = frozenset({STAGE, ORIGIN, RUNNING, ASIDE})
"""What commands keep in a campaign's folder for themselves, and some remove."""
_RUN = re.compile(r"(?P<run>[^/_.][^/]*/[0-9]+)/")


def run_of(path: str) -> str:
    """The run `<variant>/<number>` that a path of a campaign is in; empty when in none."""
    match = _RUN.match(path)
    return match["run"] if match else ""


def why_no_place(key: str) -> str:
    """Why an object cannot come into a campaign's folder; empty when it can."""
    if not is_plain(key):
        return "its name is no path in a folder"
    first = key.partition("/")[0]
    if first in _OWN or is_unfinished(first):
        return f"`{first}` is what commands keep their own files in"
    if one_line(first) != first:
        return "no configuration has such a name"
    if key.startswith(f"{run_of(key)}/{RUN_RECORD}/"):
        return f"the run's {RUN_RECORD} is no folder"
    return ""


def is_plain(path: str) -> bool:
    """True for a relative path, written in the one way there is, that leads nowhere else."""
    parts = PurePosixPath(path).parts
    plain = str(PurePosixPath(path)) == path and "\0" not in path and path[:1] != "/"
    return plain and bool(parts) and ".." not in parts


class Keys:
    """Keys that are taken: some servers lose `a/b` where there is `a`, or the other way round."""

    def __init__(self, keys: Iterable[str]) -> None:
        self._files = frozenset(keys)
        self._folders = _folders(self._files)

    def __contains__(self, key: str) -> bool:
        return key in self._files

    def beside(self, key: str) -> str:
        """The key, or one with `.1`, `.2`, … where a part of it is taken by something else."""
        *folders, name = key.split("/")
        place = ""
        for part in folders:
            place = _free(f"{place}{part}", self._files) + "/"
        place += name
        return _free(place, self._files | self._folders) if place in self._folders else place


def _free(path: str, taken: Collection[str]) -> str:
    if path not in taken:
        return path
    return next(other for number in count(1) if (other := f"{path}.{number}") not in taken)


def _folders(paths: Iterable[str]) -> frozenset[str]:
    return frozenset(str(parent) for path in paths for parent in PurePosixPath(path).parents)


def set_apart(paths: Iterable[str]) -> dict[str, str]:
    """Other places for files of which each is a folder too, since others are in it.

    The file `a` beside `a/b` is `a.1`, or the next number that is free.
    """
    files = set(paths)
    folders = _folders(files)
    taken = files | folders
    places = {}
    for path in sorted(files & folders):
        places[path] = _free(path, taken)
        taken.add(places[path])
    return places
