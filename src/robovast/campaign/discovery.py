"""Finds the campaigns in a results folder."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from robovast.base.errors import InputError
from robovast.base.file_errors import obstacle
from robovast.base.printable import is_printable, one_line
from robovast.model.naming import holds_campaign, is_campaign_dir

LOGGER = logging.getLogger(__name__)


def find_campaigns(results: Path) -> list[Path]:
    """The campaigns in a folder, sorted by name; the folder itself if it is a campaign.

    A campaign is recognized by its content; if it was aborted early, by its name. Hidden folders
    are ignored, since they are still being written. Names that no campaign or configuration can
    have (escape sequences, line ends, invalid UTF-8) are left out with a warning.

    Raises:
        InputError: the folder is missing or contains no campaign.
    """
    if not os.path.isdir(results):
        raise InputError(
            obstacle(results) or f"{results}: there is no such folder",
            hint="name a results folder or a campaign's folder",
        )
    if holds_campaign(results):
        _warn_of_names(results)
        return [results]
    visible = (path for path in sorted(results.iterdir()) if not path.name.startswith("."))
    folders = (path for path in visible if os.path.isdir(path))
    found = [path for path in folders if is_campaign_dir(path) or holds_campaign(path)]
    if not found:
        raise InputError(
            f"{results} contains no campaign: neither it nor a folder in it has a .vast file in "
            "`_config`, or reports of another tool in `<configuration>/<run number>/test.xml`",
            hint="name the results folder with `-r`",
        )
    found = [path for path in found if is_printable(path.name)]
    for folder in (results, *found):
        _warn_of_names(folder)
    return found


def _warn_of_names(folder: Path) -> None:
    odd = sorted(name for name in os.listdir(folder) if not is_printable(name))
    for path in (folder / name for name in odd):
        if os.path.isdir(path):
            LOGGER.warning(
                "%s: skipped, because it is not a valid name of a campaign or configuration. "
                "Rename it.",
                one_line(str(path)),
            )
