"""Names of bags' folders."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from pathlib import PurePath

_DATE = re.compile(r"_\d{4}_\d\d_\d\d-\d\d_\d\d_\d\d$")


def undated(name: str) -> str:
    """The name of a bag's folder without the date that the recorder has added."""
    return _DATE.sub("", name)


def ends_with(path: PurePath, wanted: str) -> bool:
    """True if a bag's path ends with names or patterns; the date of the recorder may follow."""
    end = PurePath(wanted).parts
    names = path.parts[-len(end) :]
    return len(names) == len(end) and all(
        fnmatchcase(name, pattern) or fnmatchcase(undated(name), pattern)
        for name, pattern in zip(names, end, strict=True)
    )
