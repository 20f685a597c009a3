"""File names that RoboVAST needs in a run's folder; a run's own file of such a name is renamed."""

from __future__ import annotations

from pathlib import Path

from robovast.base import safe_paths
from robovast.campaign.layout import OWN_NAMES


def set_own_names_aside(folder: Path) -> None:
    """Let a file, folder or link that a run called as one of ours be `NAME.1`, or the next free.

    Args:
        folder: of a run that is over, out of its reach; need not exist.
    """
    root = folder.parent
    for name in OWN_NAMES:
        place = safe_paths.unused(folder / name, root)
        if place.name != name:
            safe_paths.move(folder / name, root, place, root)
