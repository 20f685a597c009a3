"""Reading what others wrote into a campaign: what cannot be read is noted and left out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.findings import Findings
from robovast.base.safe_paths import MOST, read_file
from robovast.base.yaml_files import parse_yaml

LINKS = frozenset({"job"})
"""Names in a run's folder that lead out of it."""


def read_mapping(
    path: Path, findings: Findings, where: str, *, needed: bool = True, most: int = MOST
) -> dict[str, Any]:
    """A mapping in a YAML file; empty when there is none.

    Args:
        path: the file; bytes that are not UTF-8 are replaced.
        findings: is told when the file is damaged, or is needed and missing.
        where: how the place is named there.
        needed: a missing file is worth mentioning.
        most: a larger one counts as damaged [bytes].
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
        findings.missing(f"{path.name} is no mapping", where)
        return {}
    return data


@lru_cache(maxsize=64)
def _parse(content: bytes) -> Any:
    """The first document, parsed once: jobs of a machine write the same system information."""
    return parse_yaml(content.decode("utf-8", "replace").lstrip("\ufeff"))


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120]


def list_files(folder: str, prefix: str) -> Iterator[str]:
    """Files below a folder, sorted, as paths that begin with a prefix; hidden ones left out.

    Symbolic links to folders are not followed. Bytes of a name that are not UTF-8 are written
    as `\\xNN`.
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
        elif entry.is_file():
            yield prefix + name


def readable(name: str) -> str:
    """A file's name as text that can be written anywhere."""
    return name if name.isascii() else os.fsencode(name).decode("utf-8", "backslashreplace")


def subfolders(folder: Path) -> list[str]:
    """Names of the folders in a folder, sorted; hidden ones and links left out."""
    try:
        with os.scandir(folder) as scan:
            folders = (entry.name for entry in scan if entry.is_dir(follow_symlinks=False))
            return sorted(name for name in folders if not name.startswith("."))
    except OSError:
        return []
