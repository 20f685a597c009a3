"""What a stored campaign says of the inputs of a run, and these files; nobody vouches for either.

A campaign may come from anywhere. So nothing outside of it is read: no path leads out of its
folder, and no link is followed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from robovast.base import safe_paths
from robovast.base.errors import InputError
from robovast.campaign.configurations import document_path, read_configurations
from robovast.campaign.layout import CONFIGURATIONS, PARTS, POSTPROCESSING, Layout
from robovast.storage.bucket_ownership import OWNER

_OF_EXECUTION = (
    "job*",
    "bad-runs-*",
    *(Path(path).name for path in (CONFIGURATIONS, OWNER, PARTS, POSTPROCESSING)),
)
"""Names in `_transient` of what belongs to the campaign's execution."""


def read_inputs(layout: Layout, variant: str) -> dict[str, Any]:
    """The content of `configurations.yaml`, with one variant alone.

    Raises:
        InputError: it is damaged, names files outside of the campaign, or has no such variant.
    """
    check_plain(layout.configurations, layout)
    data = read_configurations(layout)
    document_path(layout, data)
    items = [item for item in data["configs"] if item["name"] == variant]
    if not items:
        raise InputError(
            f"{layout.configurations}: has no configuration `{variant}`.",
            hint="use a configuration of the campaign",
        )
    return {**data, "configs": items}


def check_inputs(run: Path, configurations: Mapping[str, Any]) -> None:
    """Refuse inputs of a run's folder that are gone, or are anything but plain files.

    Raises:
        InputError: some are.
    """
    layout, variant = Layout(run.parent.parent), run.parent.name
    for path in (layout.execution_record, *_trees(layout, variant)):
        check_plain(path, layout)
    shared = (configurations.get(key) or () for key in ("_input_files", "_run_files"))
    wanted = [layout.config / name for names in shared for name in names]
    own = configurations["configs"][0].get("_config_files") or ()
    wanted += [layout.variant_config(variant) / name for name in own]
    gone = sorted({path for path in wanted if not safe_paths.is_file(path, layout.root)})
    if gone:
        raise InputError(
            f"{run}: cannot be replayed, since files of its campaign are gone: "
            f"{', '.join(str(path.relative_to(layout.root)) for path in gone)}",
            hint="put them back, or download the campaign again",
        )


def refuse_links(layout: Layout) -> None:
    """Refuse a campaign of which a folder that RoboVAST writes to or reads inputs from is a link.

    Raises:
        InputError: one is.
    """
    own = (layout.execution, layout.transient, layout.jobs, layout.aside, layout.running)
    jobs = (layout.running / name for name in safe_paths.names(layout.running, layout.root))
    for path in (*own, *jobs):
        if os.path.islink(path):
            raise InputError(
                f"{path}: is a link, so the stored inputs would change the target of the link",
                hint="remove the link",
            )
    check_plain(layout.config, layout)


def copy_inputs(layout: Layout, variant: str, target: Layout) -> None:
    """Copy the inputs of a variant to another campaign's folder.

    Raises:
        OSError: one cannot be copied.
    """
    for path in _trees(layout, variant):
        copy = target.root / path.relative_to(layout.root)
        safe_paths.copy(path, layout.root, copy, target.root)


def _trees(layout: Layout, variant: str) -> Iterator[Path]:
    """All that a replay takes from the campaign's folder, as far as it is there."""
    for folder in (layout.config, layout.variant_config(variant)):
        if safe_paths.status(folder, layout.root) is not None:
            yield folder
    for name in safe_paths.names(layout.transient, layout.root):
        if not any(fnmatchcase(name, pattern) for pattern in _OF_EXECUTION):
            yield layout.transient / name


def check_plain(path: Path, layout: Layout) -> None:
    """Refuse a path if there is anything but plain files at it or below it.

    Raises:
        InputError: there is a link, a device or a pipe, or a part of the path is a link.
    """
    pending = [path]
    while pending:
        path = pending.pop()
        try:
            if safe_paths.is_folder(path, layout.root):
                with safe_paths.pinned(path, layout.root) as folder:
                    pending += (path / name for name in os.listdir(folder))
            else:
                with safe_paths.open_file(path, layout.root) as file:
                    safe_paths.refuse_holes(file)
        except FileNotFoundError:  # reported where it is needed
            continue
        except OSError as error:
            behind = isinstance(error, NotADirectoryError)
            why = "a part of its path is a link, or no folder" if behind else error.strerror
            raise InputError(
                f"{path}: cannot be an input of a run: {why}. Inputs are plain files of the "
                "campaign",
                hint="put a file in its place, or download the campaign again",
            ) from None
