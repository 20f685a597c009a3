"""Fetching campaigns from the share in front of a user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robovast.base.errors import InputError
from robovast.campaign.executables import warn_of_executables
from robovast.storage.shares.campaigns import NotOnShareError, download_from_share, open_share
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import say
from robovast_cli.workspace import shown


def download_shared(names: Sequence[str], output: Path, *, force: bool, keep_archive: bool) -> None:
    """Fetch the named campaigns from the share, or all.

    Args:
        names: of results folders; none means all that are on the share.
        output: folder for the campaigns' folders.
        force: also download existing campaigns and replace them.
        keep_archive: leave the archives beside the folders.
    """
    with open_share() as share, Bars() as progress:
        try:
            fetched, present = download_from_share(
                share, names, output, force=force, keep_archive=keep_archive, progress=progress
            )
        except NotOnShareError as error:
            raise InputError(f"{error} `--from cluster` looks in the cluster's storage.") from error
    for folder in fetched:
        say(f"{shown(folder)}: fetched from the share.")
        if warning := warn_of_executables(folder):
            say(warning)
    for folder in present:
        say(f"{shown(folder)}: is here; `--force` fetches it again.")
    if not fetched and not present:
        say("There is no campaign on the share.")
