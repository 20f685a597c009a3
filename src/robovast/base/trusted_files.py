"""Finds settings at or above a folder, of users whose settings the caller may obey.

On a shared machine, others can write to folders above the caller's: `/tmp`, a scratch disk, the
file share of a lab.
"""

from __future__ import annotations

import logging
import os
import stat
from functools import lru_cache
from pathlib import Path

from robovast.base.printable import one_line


def find_above(folder: Path, name: str) -> Path | None:
    """The nearest file of a name at or above a folder that the caller can trust, or None.

    A file counts if it belongs to the caller or to root, and no one else can write to it. The
    search ends at the home folder and at the border of a file system. A file that does not count
    ends the search with a warning: what lies above it was meant for others.
    """
    folder = folder.absolute()
    device = _device(folder)
    for place in (folder, *folder.parents):
        path = place / name
        if _device(place) != device:
            return None
        if os.path.lexists(path) and not path.is_dir():
            why = _why_untrusted(path)
            if why:
                _warn(str(path), why)
            return None if why else path
        if place == _home():
            return None
    return None


def _home() -> Path | None:
    try:
        return Path.home()
    except RuntimeError:  # a user without an entry, such as in a container
        return None


def _device(folder: Path) -> int | None:
    try:
        return folder.stat().st_dev
    except OSError:
        return None


def _why_untrusted(path: Path) -> str:
    """Why a file is not obeyed; empty if it is. Of a link, both ends count."""
    try:
        ends = (path.lstat(), path.stat())
    except OSError as error:
        return f"it cannot be read ({error.strerror})"
    if any(end.st_uid not in {os.geteuid(), 0} for end in ends):
        return "it belongs to another user"
    mode = ends[1].st_mode
    if not stat.S_ISREG(mode):
        return "it is not a regular file"
    if mode & stat.S_IWOTH or (mode & stat.S_IWGRP and not _is_private(ends[1])):
        return "other users can write to it"
    return ""


def _is_private(found: os.stat_result) -> bool:
    """Whether a group is the owner's alone, as many distributions create one for each user."""
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(found.st_gid), pwd.getpwuid(found.st_uid)
    except KeyError:
        return False
    return group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}


@lru_cache
def _warn(path: str, why: str) -> None:
    logging.getLogger(__name__).warning(
        "%s is not used, because %s. If you trust it, copy it to your own folder, or change its "
        "owner and permissions (`chown`, `chmod go-w`).",
        one_line(path),
        why,
    )
