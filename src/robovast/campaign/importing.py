"""Imports a campaign from an archive."""

from __future__ import annotations

import os
from pathlib import Path

from robovast.base import safe_paths
from robovast.base.atomic import put_in_place, scratch_folder, storage_errors
from robovast.base.errors import InputError
from robovast.base.printable import one_line
from robovast.campaign.archive import refuse_links_out, unpack
from robovast.campaign.imported import mark_imported
from robovast.campaign.layout import Layout
from robovast.campaign.object_keys import OF_ONE_MACHINE
from robovast.model.naming import holds_campaign

_SUFFIXES = (".tar.gz", ".tgz", ".tar.xz", ".tar.bz2", ".tar", ".zip")


def import_archive(archive: Path, output: Path, *, force: bool = False) -> Path:
    """Unpack a campaign's archive and return the campaign's folder.

    The campaign appears complete or not at all, and is marked as imported.

    Args:
        archive: a tar file (any compression) or zip file that contains the campaign's folder, or
            only the folder's content; then the archive's name becomes the campaign's name.
        output: parent of the campaign's folder; created if missing.
        force: replace a campaign of the same name.

    Raises:
        InputError: the archive cannot be read, is unsafe, or contains no campaign.
        StorageError: the campaign exists already, or cannot be written.
    """
    name = campaign_of_archive(archive.name)
    with storage_errors(output), scratch_folder(output / name) as scratch:
        whole = scratch / name
        whole.mkdir()
        links = unpack(archive, whole)
        campaign = _campaign_in(archive, whole)
        _check_names(archive, campaign)
        refuse_links_out(archive, links, campaign)
        for own in OF_ONE_MACHINE:
            safe_paths.remove(campaign / own, campaign)
        mark_imported(campaign)
        put_in_place(campaign, output / campaign.name, replace=force)
    return output / campaign.name


def _check_names(archive: Path, campaign: Path) -> None:
    """Refuse names that no campaign can have and that could deceive the reader."""
    if campaign.name.startswith((".", "_")):
        raise InputError(
            f"{archive}: rejected, because its campaign is called `{campaign.name}`: names of "
            "campaigns cannot begin with `.` or `_`. Nothing was imported",
            hint="rename the campaign's folder, and pack it again",
        )
    for path in (campaign, *campaign.iterdir()):
        if one_line(path.name) != path.name:
            raise InputError(
                f"{archive}: rejected, because the name `{one_line(path.name)}` in it contains "
                "control characters. Nothing was imported.",
                hint="rename it, and pack the campaign again",
            )
    for run in Layout(campaign).misnumbered_runs():
        raise InputError(
            f"{archive}: rejected, because `{run}` cannot be the folder of a run. A run has a "
            "number with at most nine digits and no leading zeros. Nothing was imported",
            hint="rename the folder, and pack the campaign again",
        )


def campaign_of_archive(name: str) -> str:
    """Name of the campaign in an archive of this file name."""
    suffix = next((suffix for suffix in _SUFFIXES if name.endswith(suffix)), "")
    return name.removesuffix(suffix) or "campaign"


def _few(names: list[str]) -> str:
    return ", ".join([*sorted(names)[:5], *(["…"] if len(names) > 5 else [])])


def _campaign_in(archive: Path, whole: Path) -> Path:
    content = list(whole.iterdir())
    folder = content[0] if len(content) == 1 else whole
    if not os.path.islink(folder) and holds_campaign(folder):
        return folder
    if len(several := [path.name for path in content if holds_campaign(path)]) > 1:
        raise InputError(
            f"{archive}: contains {len(several)} campaigns ({_few(several)}). Nothing was imported",
            hint="create an archive of each campaign",
        )
    names = _few([path.name for path in content]) or "nothing"
    raise InputError(
        f"{archive} contains no campaign, but {names}. It must contain one campaign's folder, with "
        "a .vast file in `_config`, or with reports of another tool in "
        "`<configuration>/<run number>/test.xml`. Nothing was imported."
    )
