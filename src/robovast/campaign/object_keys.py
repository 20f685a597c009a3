"""Maps the object keys of a bucket to paths in a campaign's folder.

Keys may be any text, and `a` and `a/b` may both exist; whoever may write to the bucket chooses
them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from itertools import count
from pathlib import PurePosixPath

from robovast.base.atomic import is_unfinished
from robovast.base.printable import one_line
from robovast.campaign.imported import MARK
from robovast.campaign.layout import ASIDE, RUN_RECORD, RUNNING, STAGE

ORIGIN = ".bucket"
"""File in a campaign's folder of the page's mirror that names the campaign's bucket."""
OMITTED = ".omitted"
"""File in a campaign's folder of the page's mirror that states why the campaign is not mirrored."""

OF_ONE_MACHINE = frozenset({STAGE, ORIGIN, OMITTED, RUNNING})
"""What commands note in a campaign's folder about this machine; of others it means nothing."""
_OWN = OF_ONE_MACHINE | {ASIDE, MARK}
"""Names that commands use internally, and partly remove."""
_RUN = re.compile(r"(?P<run>[^/_.][^/]*/(?:0|[1-9][0-9]{0,8}))/")


def run_of(path: str) -> str:
    """The run `<variant>/<number>` that contains a path of the campaign; empty if none does."""
    match = _RUN.match(path)
    return match["run"] if match else ""


def why_no_place(key: str) -> str:
    """Why an object cannot be stored in a campaign's folder; empty if it can."""
    if not is_plain(key):
        return "its name is not a path within a folder"
    first = key.partition("/")[0]
    if first in _OWN or is_unfinished(first):
        return f"`{first}` is reserved for the commands' own files"
    if one_line(first) != first:
        return "a configuration cannot have such a name"
    if key.startswith(f"{run_of(key)}/{RUN_RECORD}/"):
        return f"the run's {RUN_RECORD} is not a folder"
    return ""


def is_plain(path: str) -> bool:
    """Whether a path is relative, normalized and stays in its folder."""
    parts = PurePosixPath(path).parts
    plain = str(PurePosixPath(path)) == path and "\0" not in path and path[:1] != "/"
    return plain and bool(parts) and ".." not in parts


class Keys:
    """Used keys; some servers lose `a/b` if there is an `a`, or the other way round."""

    def __init__(self, keys: Iterable[str]) -> None:
        self._files = frozenset(keys)
        self._folders = _folders(self._files)

    def __contains__(self, key: str) -> bool:
        return key in self._files

    def beside(self, key: str) -> str:
        """The key itself, or with `.1`, `.2`, … after a part that conflicts with another key."""
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
    """New paths for files whose path is also a folder of other files.

    The file `a` beside `a/b` becomes `a.1`, or gets the next free number.
    """
    files = set(paths)
    folders = _folders(files)
    taken = files | folders
    places = {}
    for path in sorted(files & folders):
        places[path] = _free(path, taken)
        taken.add(places[path])
    return places
