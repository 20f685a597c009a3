"""Marks campaigns that came in an archive: no one on this machine vouches for their content."""

from __future__ import annotations

import os
from pathlib import Path

from robovast.base import safe_paths

MARK = ".imported"
"""File in a campaign's folder. It is written after the archive's content, so that an archive can
neither bring nor remove it; a user who trusts the campaign may delete it."""


def mark_imported(campaign: Path) -> None:
    """Mark a campaign as imported."""
    safe_paths.create_file(campaign / MARK, campaign).close()


def is_imported(campaign: Path) -> bool:
    """Whether a campaign is marked as imported."""
    return os.path.lexists(campaign / MARK)
