"""Download campaigns from the file share, and report progress."""

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
    """Download the named campaigns from the file share, or all.

    Args:
        names: of results folders; none means all campaigns on the file share.
        output: folder for the campaigns' folders.
        force: also download existing campaigns and replace them.
        keep_archive: leave the archives next to the folders.
    """
    with open_share() as share, Bars() as progress:
        try:
            fetched, present = download_from_share(
                share, names, output, force=force, keep_archive=keep_archive, progress=progress
            )
        except NotOnShareError as error:
            raise InputError(
                f"{error.message}", hint="use `--from cluster` to search the object storage"
            ) from error
    for folder in fetched:
        say(f"{shown(folder)}: downloaded from the file share.")
        if warning := warn_of_executables(folder):
            say(warning)
    for folder in present:
        say(f"{shown(folder)}: already exists. `--force` downloads it again.")
    if not fetched and not present:
        say("No campaigns on the file share.")
