"""Reads others' files in a campaign; unreadable ones are reported and left out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.problems import Findings
from robovast.base.safe_paths import MOST, read_file
from robovast.base.yaml_files import parse_yaml

LINKS = frozenset({"job"})
"""Suffixes of links in a run's folder that leave it."""


def read_mapping(
    path: Path, findings: Findings, where: str, *, needed: bool = True, most: int = MOST
) -> dict[str, Any]:
    """Read a mapping from a YAML file; empty if the file is missing.

    Args:
        path: the file; bytes that are not UTF-8 are replaced.
        findings: collects damaged files, and missing ones if they are needed.
        where: the location's name in findings.
        needed: whether a missing file is reported.
        most: largest size; larger files count as damaged [bytes].
    """
    try:
        data = _parse(read_file(path, most=most))
    except FileNotFoundError:
        if needed:
            findings.missing(f"no {path.name}", where)
        return {}
    except (OSError, ValueError) as error:
        findings.missing(f"{path.name} cannot be read ({_short(error)})", where)
        return {}
    if not isinstance(data, dict):
        findings.missing(f"{path.name} is not a mapping", where)
        return {}
    return data


@lru_cache(maxsize=64)
def _parse(content: bytes) -> Any:
    """Parse the first document; cached, since a machine's jobs write equal system information."""
    return parse_yaml(content.decode("utf-8", "replace").lstrip("\ufeff"))


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120]


def list_files(folder: str, prefix: str) -> Iterator[str]:
    """Files in a folder, sorted, with a prefix; hidden files are left out.

    Symbolic links to folders are not followed. Invalid UTF-8 bytes in names are written as `\\xNN`.
    """
    try:
        with os.scandir(folder) as scan:
            entries = sorted(scan, key=lambda entry: entry.name)
    except OSError:
        return
    for entry in entries:
        name = readable(entry.name)
        if name.startswith(".") or name in LINKS:
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from list_files(entry.path, f"{prefix}{name}/")
        elif entry.is_file(follow_symlinks=False) or os.path.isfile(entry.path):
            yield prefix + name


def readable(name: str) -> str:
    """A file's name as text that can be encoded."""
    return name if name.isascii() else os.fsencode(name).decode("utf-8", "backslashreplace")


def subfolders(folder: Path) -> list[str]:
    """Names of subfolders, sorted, without hidden ones and links."""
    try:
        with os.scandir(folder) as scan:
            folders = (entry.name for entry in scan if entry.is_dir(follow_symlinks=False))
            return sorted(name for name in folders if not name.startswith("."))
    except OSError:
        return []
