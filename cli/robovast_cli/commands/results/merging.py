"""Merging campaigns in front of a user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robovast.campaign.merge import MergeResult, merge_campaigns
from robovast_cli.ui.output import say
from robovast_cli.ui.table import counted
from robovast_cli.ui.working import working
from robovast_cli.workspace import shown


def merge(
    sources: Sequence[Path],
    target: Path,
    noun: str,
    *,
    by_name: bool = False,
    replace: bool = False,
) -> MergeResult:
    """Merge campaigns into a new folder; say what was merged, and what was not.

    Args:
        sources: their folders, which stay.
        target: the new folder.
        noun: what they are called.
        by_name: they are parts of one campaign, in which each configuration has its own name.
        replace: replace an existing folder, at the very end.

    Raises:
        InputError: they cannot be merged.
        StorageError: the target exists already, or cannot be written.
    """
    with working(f"Merging {counted(len(sources), noun)}"):
        result = merge_campaigns(sources, target, by_name=by_name, replace=replace)
    for path in result.unidentified:
        say(f"{path}: has no config_identifier, so it was merged with nothing.")
    for path in result.left_out:
        say(f"{path}: left out, because it has no `run.json` of a run that went to its end.")
    say(
        f"Merged {counted(len(sources), noun)} into {shown(target)}: "
        f"{counted(result.configurations, 'configuration')}, {counted(result.runs, 'run')}."
    )
    return result
