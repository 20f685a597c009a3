"""Detects changed files: quickly by time stamps, reliably by content."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import BinaryIO

from robovast.base.safe_paths import extents, has_holes, open_file, read_file, status
from robovast.campaign.layout import POSTPROCESSING, RUN_RECORD
from robovast.campaign.run_record import PLACE, record_text

_CHUNK = 1 << 20
_BYTECODE = "__pycache__"
"""Folder that Python itself makes, wherever a plugin's file imports another."""

_LONGEST = os.pathconf("/", "PC_PATH_MAX") - len("/")
"""Length of a path from which on the system refuses it, that of a folder being looked into
[bytes]."""

Stamp = tuple[int, int, int]
"""Size [bytes], times of modification and change [ns]."""
Files = dict[str, Stamp]
"""All files in a folder by relative path; links are not followed."""


def scan(folder: str | Path, ignored: Iterable[str] = (POSTPROCESSING,)) -> Files:
    """The files in a folder, apart from those whose path is too long for any program to open.

    Args:
        folder: the folder; a missing one has no files.
        ignored: names directly in the folder that are ignored; Python's bytecode is, everywhere.
    """
    found: Files = {}
    ignored, pending = frozenset(ignored), [""] if os.path.isdir(folder) else []
    try:
        while pending:
            prefix = pending.pop()
            with os.scandir(f"{folder}/{prefix}") as entries:
                for entry in entries:
                    if not _counts(entry, () if prefix else ignored):
                        continue
                    if entry.is_dir(follow_symlinks=False):
                        pending.append(f"{prefix}{entry.name}/")
                    else:
                        at = entry.stat(follow_symlinks=False)
                        found[prefix + entry.name] = (at.st_size, at.st_mtime_ns, at.st_ctime_ns)
    except FileNotFoundError:
        return {}
    return found


def _counts(entry: os.DirEntry[str], ignored: Container[str]) -> bool:
    is_ours = entry.name in ignored or entry.name == _BYTECODE
    return not is_ours and len(os.fsencode(entry.path)) < _LONGEST


def stamp_of(path: str) -> int:
    """Modification time of a folder [ns]; 0 if it is missing."""
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


def signature(files: Files, beside: Iterable[int] = ()) -> str:
    """A digest that stays the same while no file changes.

    Args:
        files: result of `scan`.
        beside: further time stamps to include.
    """
    text = f"{sorted(files.items())}{list(beside)}"
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content, or of a link's target; of sparse files, which may have any size,
    only the data between the holes is hashed."""
    if os.path.islink(path):
        return hashlib.sha256(os.readlink(path).encode(errors="surrogateescape")).hexdigest()
    with open_file(path) as file:
        if has_holes(file):
            return _digest_of_extents(file)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digest_of_extents(file: BinaryIO) -> str:
    digest = hashlib.sha256(str(os.fstat(file.fileno()).st_size).encode())
    for begin, end in extents(file):
        digest.update(f"{begin}-{end}".encode())
        file.seek(begin)
        while begin < end and (chunk := file.read(min(end - begin, _CHUNK))):
            begin += len(chunk)
            digest.update(chunk)
    return digest.hexdigest()


def _record_digest(path: Path) -> str:
    """Digest of a record without its reference to a bucket; empty if it has none."""
    try:
        record = json.loads(read_file(path))
        del record[PLACE]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return ""
    return hashlib.sha256(record_text(record).encode()).hexdigest()


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of files by relative path; only regular files are included."""
    paths = ((name, folder / name) for name in sorted(names))
    return {n: _digest(n, path) for n, path in paths if _is_plain(path)}


def _digest(name: str, path: Path) -> str:
    return (name == RUN_RECORD and _record_digest(path)) or file_digest(path)


def _is_plain(path: Path) -> bool:
    found = status(path, path.parent)
    return found is not None and (stat.S_ISLNK(found.st_mode) or stat.S_ISREG(found.st_mode))


def combined(parts: Mapping[str, str]) -> str:
    """One digest of several named digests."""
    text = repr(sorted(parts.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def changed(before: Files, after: Files) -> list[str]:
    """New and changed files, sorted."""
    return sorted(name for name, stamp in after.items() if before.get(name) != stamp)
