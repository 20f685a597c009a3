"""Which inputs of a campaign are not those that it began with.

Runs that share a rate must have had the same files; who edits some in between is told.
"""

from __future__ import annotations

import json
from contextlib import suppress

from robovast.base import safe_paths
from robovast.campaign.checksums import checksum
from robovast.campaign.layout import INPUTS, Layout
from robovast.campaign.object_keys import is_plain
from robovast.model.document import Document
from robovast.model.inputs import container_files


def record_inputs(document: Document, layout: Layout) -> None:
    """Store the checksums of the .vast file and of all files that every run needs."""
    names = [document.path.name, *map(str, container_files(document))]
    sums = {name: _checksum(layout, name) for name in names}
    known = {name: found for name, found in sums.items() if found}
    (layout.root / INPUTS).write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")


def edited_inputs_warning(layout: Layout) -> str:
    """A warning about inputs that were edited since; empty if none was, or if nothing is recorded,
    as in campaigns of RoboVAST 1.x."""
    edited = [name for name, then in _recorded(layout).items() if _checksum(layout, name) != then]
    if not edited:
        return ""
    others = f" and {len(edited) - 1} more" if len(edited) > 1 else ""
    return (
        f"{layout.config / edited[0]}{others}: edited after the start of the campaign, so further "
        "runs would have different inputs. Restore the files, or start another campaign."
    )


def _recorded(layout: Layout) -> dict[str, str]:
    data = None
    with suppress(OSError, ValueError), safe_paths.open_file(layout.root / INPUTS) as file:
        data = json.load(file)
    sums = data if isinstance(data, dict) else {}
    return {name: found for name, found in sums.items() if is_plain(name)}


def _checksum(layout: Layout, name: str) -> str:
    """SHA-256 of a file of `_config`; empty if it cannot be read."""
    with suppress(OSError):
        return checksum(layout.config / name, layout.root)
    return ""
