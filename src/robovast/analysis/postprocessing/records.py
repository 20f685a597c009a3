"""`postprocessing.yaml`: which command made each file of a run, and from which sources."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from robovast.analysis.postprocessing.outcome import Entry
from robovast.base.atomic import write_atomically
from robovast.base.serialization import dump_yaml, to_plain
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.layout import POSTPROCESSING, Layout
from robovast.campaign.object_keys import run_of


def with_found(
    entries: Iterable[Entry], found: Iterable[str], plugin: str, parameters: Mapping[str, Any]
) -> list[Entry]:
    """Add an entry for each found file that has none.

    Args:
        entries: entries of a command.
        found: files that the command made, relative to the campaign.
        plugin: the command's name.
        parameters: the command's parameters.
    """
    said = list(entries)
    named = {entry["output"] for entry in said}
    names = {os.fsencode(path).decode(errors="replace") for path in found}
    rest = sorted(names - named)
    facts = {"sources": [], "plugin": plugin, "params": dict(parameters)}
    return said + [{"output": path, **facts} for path in rest]


def merge(campaign: Path, entries: Iterable[Entry]) -> None:
    """Write entries to the folders of their runs; entries without a run go to `_transient`.

    An entry replaces one with the same output and plugin.
    """
    grouped: dict[str, list[Entry]] = {}
    for entry in entries:
        grouped.setdefault(run_of(entry["output"]), []).append(entry)
    for run, items in grouped.items():
        folder = campaign / run if run else Layout(campaign).transient
        if os.path.isdir(folder) or not run:
            folder.mkdir(exist_ok=True)
            update(folder / POSTPROCESSING, items)


def update(path: Path, entries: Iterable[Entry], **facts: Any) -> None:
    """Write entries and other facts to one file."""
    before = read_mapping_leniently(path)
    old = before.get("entries")
    merged = {_identity(e): e for e in old if isinstance(e, dict)} if isinstance(old, list) else {}
    merged.update({_identity(entry): entry for entry in entries})
    after = to_plain({**before, **facts, "entries": list(merged.values())})
    if after != before:
        write_atomically(path, dump_yaml(after), lasting=False)


def _identity(entry: Entry) -> tuple[str, str]:
    return str(entry.get("output")), str(entry.get("plugin"))
