"""Finds campaigns and their jobs in progress."""

from __future__ import annotations

import os
import re
from pathlib import Path

from robovast.base.errors import InputError
from robovast.base.locks import is_locked
from robovast.campaign.layout import JOBS, RUNNING, SEARCH, SYSTEM_LOG, is_variant
from robovast.evaluation.summaries import ActiveJob
from robovast.model.naming import holds_campaign

_JOB = re.compile(r"job-([0-9]{1,9})")


def find_campaigns(results: Path) -> list[str]:
    """Names of the campaigns in a results folder, the newest first.

    Raises:
        InputError: the folder cannot be read.
    """
    try:
        folders = [entry for entry in os.scandir(results) if is_own_folder(entry)]
    except OSError as error:
        raise InputError(
            f"{results}: cannot be read: {error.strerror}", hint="name the results folder with `-r`"
        ) from None
    names = [entry.name for entry in folders if holds_campaign(Path(entry))]
    return sorted(names, key=lambda name: (name[-17:], name), reverse=True)  # by the time in it


def is_own_folder(entry: os.DirEntry[str]) -> bool:
    """Whether an entry is a folder (not a link) of results; `_` and `.` begin other names.

    Names that are not UTF-8 or cannot be printed are excluded, too.
    """
    return is_variant(entry.name) and entry.is_dir(follow_symlinks=False)


def is_search(results: Path, campaign: str) -> bool:
    """Whether a campaign is a search that has proposed something."""
    return os.path.isdir(results / campaign / SEARCH)


def active_jobs(results: Path, campaign: str) -> tuple[ActiveJob, ...] | None:
    """A campaign's jobs in progress, in order; None if it is not being executed."""
    root = results / campaign
    if not is_locked(root / RUNNING):
        return None
    try:
        found = [_JOB.fullmatch(name) for name in os.listdir(root / RUNNING)]
    except OSError:  # it has just ended
        return ()
    numbers = sorted(int(match[1]) for match in found if match)
    return tuple(ActiveJob(f"job-{n}", _log(root, f"job-{n}")) for n in numbers)


def _log(root: Path, job: str) -> str | None:
    """The job's own log, else what its process prints."""
    candidates = (f"{JOBS}/{job}/{SYSTEM_LOG}", f"{RUNNING}/{job}/console.log")
    found = (path for path in candidates if os.path.isfile(root / path))
    return next((f"{root.name}/{path}" for path in found), None)
