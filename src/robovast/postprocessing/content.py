"""Whether files changed: cheaply by their time stamps, surely by their content."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

Stamp = tuple[int, int, int]
"""Size [bytes], modified and changed [ns]."""
Files = dict[str, Stamp]
"""Every file below a folder by its relative path; links are not followed."""

RECORD = "postprocessing.yaml"
"""What made which file; written by the orchestration itself, so no input of anything."""


def scan(folder: str | Path, ignored: Iterable[str] = (RECORD,)) -> Files:
    """The files below a folder.

    Args:
        folder: where; one that is not there has no files.
        ignored: names in the folder itself that do not count.
    """
    found: Files = {}
    try:
        _scan(str(folder), "", found, frozenset(ignored))
    except FileNotFoundError:
        return {}
    return found


def _scan(folder: str, prefix: str, found: Files, ignored: frozenset[str]) -> None:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name in ignored:
                continue
            if entry.is_dir(follow_symlinks=False):
                _scan(entry.path, f"{prefix}{entry.name}/", found, frozenset())
            else:
                status = entry.stat(follow_symlinks=False)
                stamp = (status.st_size, status.st_mtime_ns, status.st_ctime_ns)
                found[prefix + entry.name] = stamp


def stamp_of(path: str) -> int:
    """When a folder's list of files changed [ns]; 0 when it is not there."""
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


def signature(files: Files, beside: Iterable[int] = ()) -> str:
    """A digest that is equal when no file changed since.

    Args:
        files: what `scan` found.
        beside: time stamps of what else counts.
    """
    text = f"{sorted(files.items())}{list(beside)}"
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content, or of where a link points."""
    if path.is_symlink():
        return hashlib.sha256(os.readlink(path).encode(errors="surrogateescape")).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of files by their relative path; what is no plain file is left out."""
    paths = ((name, folder / name) for name in sorted(names))
    return {n: file_digest(path) for n, path in paths if path.is_symlink() or path.is_file()}


def combined(parts: Mapping[str, str]) -> str:
    """One digest of several named ones."""
    text = repr(sorted(parts.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def changed(before: Files, after: Files) -> list[str]:
    """Files that are new, or not what they were; sorted."""
    return sorted(name for name, stamp in after.items() if before.get(name) != stamp)
