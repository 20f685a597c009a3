"""Renames a run's files whose names RoboVAST needs for its own files in the run's folder."""

from __future__ import annotations

from pathlib import Path

from robovast.base import safe_paths
from robovast.campaign.layout import OWN_NAMES


def set_own_names_aside(folder: Path) -> None:
    """Rename files, folders and links with reserved names to `NAME.1`, or the next free number.

    Args:
        folder: folder of a finished run; need not exist.
    """
    root = folder.parent
    for name in OWN_NAMES:
        place = safe_paths.unused(folder / name, root)
        if place.name != name:
            safe_paths.move(folder / name, root, place, root)
