"""What a campaign says of itself, and how the inputs of two campaigns differ."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from robovast.base.bounds import Bound
from robovast.base.errors import InputError
from robovast.campaign.layout import EXECUTION_RECORD
from robovast.campaign.planned_runs import MORE_RUNS, RUNS
from robovast.evaluation.confined_files import open_inside, read_small, resolved
from robovast.evaluation.files import list_files
from robovast.evaluation.untrusted_data import LONGEST, mapping, parse_yaml, read_yaml
from robovast.model.naming import CONFIG

LONGEST_TEXT = 2_000
"""Longest files whose lines are compared [lines]; the time may grow with the cube of it."""
_SECONDS = 2.0
"""How long lines of all files may be compared; after that, only which files differ is told."""
MOST_LINES = 400
"""Lines of a difference that are shown."""
_CIRCUMSTANCES = (
    "image",
    "image_revision",
    "robovast_version",
    "execution_type",
    "env",
    RUNS,
    MORE_RUNS,
)
"""Keys of execution.yaml that may explain a difference."""

Place = tuple[Path, str]
"""A results folder, without links, and the name of a campaign in it."""


@dataclass(frozen=True)
class SourceFile:
    """A text file of a campaign."""

    name: str
    text: str


@dataclass(frozen=True)
class About:
    """What a campaign says of itself."""

    title: str
    description: str
    sources: list[SourceFile]
    """The .vast file and the scenario."""


@dataclass(frozen=True)
class Change:
    """A difference between two campaigns."""

    name: str
    """A file of `_config`, or a key of execution.yaml."""
    kind: Literal["changed", "added", "removed"]
    lines: list[str]
    """A unified diff without its head; empty for what is no text, or too long."""
    more: int
    """Lines that are left out."""


def about(results: Path, campaign: str) -> About:
    """Title, description and sources of a campaign; what it does not have is empty."""
    name, data = read_document(results, campaign)
    metadata = mapping(data.get("metadata"))
    scenario = str(mapping(data.get("execution")).get("scenario_file", ""))
    texts = [(file, _text(results, campaign, file)) for file in (name, scenario) if file]
    return About(
        title=_shown(metadata.get("title")),
        description=_shown(metadata.get("description")),
        sources=[SourceFile(file, text) for file, text in texts if text is not None],
    )


def read_document(results: Path, campaign: str) -> tuple[str, Mapping[str, Any]]:
    """Name and content of a campaign's .vast file; both are empty where there is none."""
    try:
        files = [entry.name for entry in list_files(results, f"{campaign}/{CONFIG}")]
    except InputError:
        files = []
    name = next(filter(_is_document, files), "")
    content = _content(results, campaign, name) if name else None
    return name, mapping(parse_yaml(content or b""))


def digests(results: Path, folder: str) -> dict[str, str]:
    """A digest of each file of a folder below the results folder, by its path in that folder.

    Files that cannot be read have an empty digest; a missing folder has no files.
    """
    try:
        names = [entry.name for entry in list_files(results, folder)]
    except InputError:
        return {}
    return {name: _digest(results, f"{folder}/{name}") for name in names}


def _digest(results: Path, path: str) -> str:
    try:
        status = resolved(results, path).stat()
        return _digest_of(results, path, status.st_size, status.st_mtime_ns)
    except (InputError, OSError):
        return ""


@lru_cache(maxsize=16384)
def _digest_of(results: Path, path: str, *_: int) -> str:
    """The digest of a file; size and time of its last change tell its versions apart."""
    with open_inside(results, path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def changes(before: Place, after: Place) -> list[Change]:
    """What differs between the inputs of two campaigns: their execution and their files."""
    return [*_circumstances(before, after), *_changed_files(before, after)]


def _circumstances(before: Place, after: Place) -> Iterator[Change]:
    one, other = (
        read_yaml(results, f"{name}/{EXECUTION_RECORD}") for results, name in (before, after)
    )
    for key in _CIRCUMSTANCES:
        if one.get(key) != other.get(key):
            lines = [f"-{_shown(one.get(key)) or '–'}", f"+{_shown(other.get(key)) or '–'}"]
            yield Change(key, "changed", lines, 0)


def _changed_files(before: Place, after: Place) -> Iterator[Change]:
    one, other = (digests(results, f"{name}/{CONFIG}") for results, name in (before, after))
    bound = Bound(_SECONDS)
    for name in sorted({**one, **other}, key=lambda name: (not _is_document(name), name)):
        if one.get(name) == other.get(name):
            continue
        old = _content(*before, name) if name in one else b""
        new = _content(*after, name) if name in other else b""
        lines = [] if bound.late() else _diff(old, new)
        yield Change(
            name,
            "added" if name not in one else "removed" if name not in other else "changed",
            lines[:MOST_LINES],
            max(0, len(lines) - MOST_LINES),
        )


def _diff(old: bytes | None, new: bytes | None) -> list[str]:
    """A unified diff; empty for what is no text, or too long to compare in a moment."""
    try:
        one, other = ((content or b"").decode().splitlines() for content in (old, new))
    except UnicodeDecodeError:
        return []
    if None in (old, new) or max(len(one), len(other)) > LONGEST_TEXT:
        return []
    found = difflib.unified_diff(one, other, lineterm="", n=1)
    return [line[:LONGEST] for line in found][2:]


def _is_document(name: str) -> bool:
    return name.endswith(".vast") and "/" not in name


def _content(results: Path, campaign: str, name: str) -> bytes | None:
    """A file of a campaign's inputs; None if it is too large or cannot be read."""
    try:
        return read_small(results, f"{campaign}/{CONFIG}/{name}")
    except InputError:
        return None


def _text(results: Path, campaign: str, name: str) -> str | None:
    content = _content(results, campaign, name)
    return None if content is None else content.decode(errors="replace")


def _shown(value: Any) -> str:
    if isinstance(value, Mapping | list):
        return str(value)[:LONGEST]
    return "" if value is None else str(value)[:LONGEST]
