"""The files that a .vast document names, found relative to its folder."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from robovast.model.naming import CONFIG_MOUNT, holds_campaign, is_campaign_dir

_NO_INPUTS = frozenset({"__pycache__"})
"""Folders that other tools generate; run files are never searched there."""

_PREPARED = "out_template"
"""Folder that `prepare-run` writes."""


def match_run_files(folder: Path, pattern: str) -> list[Path]:
    """Files that match a pattern of `run_files`, relative to the folder, sorted.

    `*` also matches `/`: `files/*` means everything below `files`. A pattern without `/` also
    matches bare file names in any folder; a pattern that ends with `/` means a folder. Hidden files
    match only if the pattern names them. Campaigns below the folder, executed or prepared, never
    match, because they contain copies of the same files.
    """
    named = {Path(name) for name in glob.glob(pattern, root_dir=folder, recursive=True)}
    below = {path for path in _visible_files(folder) if _matches(path, pattern)}
    return sorted(path for path in named | below if _is_input(folder, path))


def _visible_files(folder: Path) -> Iterator[Path]:
    for root, folders, names in os.walk(folder):
        below = Path(root)
        folders[:] = [name for name in folders if _may_hold_inputs(below / name)]
        yield from ((below / name).relative_to(folder) for name in names if name[0] != ".")


def _may_hold_inputs(folder: Path) -> bool:
    return folder.name[0] != "." and folder.name not in _NO_INPUTS and not _is_campaign(folder)


def _is_campaign(folder: Path) -> bool:
    """True when a folder is named like a campaign or contains what only campaigns contain.

    Merged, generated and prepared campaigns may have any name.
    """
    is_prepared = os.path.isdir(folder / _PREPARED)
    return is_prepared or is_campaign_dir(folder) or holds_campaign(folder)


def _matches(path: Path, pattern: str) -> bool:
    name = path.as_posix()
    if pattern.endswith("/"):
        return name.startswith(pattern.removeprefix("./"))
    return any(fnmatchcase(text, pattern) for text in (name, f"/{name}", path.name))


def _is_input(folder: Path, relative: Path) -> bool:
    if relative.is_absolute() or ".." in relative.parts or not os.path.isfile(folder / relative):
        return False
    if not _NO_INPUTS.isdisjoint(relative.parts):
        return False
    above = relative.parents[:-1]  # the document's own folder may have any name
    return not any(_is_campaign(folder / parent) for parent in above)


def run_files(folder: Path, patterns: list[str]) -> list[Path]:
    """Files that match any of the patterns, relative to the folder, sorted, each once."""
    return sorted({path for pattern in patterns for path in match_run_files(folder, pattern)})


def host_path(folder: Path, command: str) -> Path | None:
    """The file behind a container's command, or None when it does not come from the folder."""
    return folder / command.removeprefix(CONFIG_MOUNT) if command.startswith(CONFIG_MOUNT) else None


def named_files(folder: Path, value: Any) -> Iterator[Path]:
    """Files named in a plugin's parameters, at any depth; paths are relative to the folder.

    Args:
        folder: the document's folder.
        value: the parameters, or a part of them.
    """
    if isinstance(value, str):
        if value and os.path.isfile(folder / value):
            yield Path(value)
    elif isinstance(value, dict):
        for item in value.values():
            yield from named_files(folder, item)
    elif isinstance(value, list):
        for item in value:
            yield from named_files(folder, item)
