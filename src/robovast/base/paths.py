"""Normalizes paths that a user gives."""

from __future__ import annotations

import os
from pathlib import Path


def normalized(path: Path) -> Path:
    """A path without `..`, so that it can be compared with paths below it.

    The part up to the last `..` is resolved as the operating system does it: links are followed.
    """
    parts = path.parts
    if ".." not in parts:
        return path
    end = len(parts) - parts[::-1].index("..")
    return Path(os.path.realpath(Path(*parts[:end])), *parts[end:])
