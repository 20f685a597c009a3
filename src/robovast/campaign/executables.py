"""Code that a campaign brings along, for users to look at before commands execute it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast.base.plugins import split_file_reference
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.layout import Layout

_SECTIONS = ("results_processing", "analysis")
_CALLS = ("postprocessing", "metadata_processing", "publication")
_SHELL = "command"
"""The postprocessing command that executes any other."""


_NAMED = 5
"""How much is named in a message."""


def executables_of(campaign: Path) -> list[str]:
    """Plugins in files, postprocessing commands and notebooks of a campaign, each described."""
    config = Layout(campaign).config
    notebooks = (f"notebook `{path.relative_to(config)}`" for path in config.rglob("*.ipynb"))
    calls = (call for path in config.glob("*.vast") for call in _calls(path))
    return sorted({*filter(None, map(_described, calls)), *notebooks})


def warn_of_executables(campaign: Path) -> str | None:
    """What to tell who took a campaign over from elsewhere; None when nothing would be executed."""
    found = executables_of(campaign)
    if not found:
        return None
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return (
        f"{campaign.name} brings what is executed with your rights: {', '.join(found[:_NAMED])}"
        f"{more}. Look at it first, or leave it out: `vast results metadata --no-plugins`, "
        "`vast evaluation gui --skip-postprocessing`."
    )


def _calls(document: Path) -> Iterator[Any]:
    """Every entry of a document that may name a plugin; what is of another form names none."""
    data = read_mapping_leniently(document)  # what is damaged, no command reads, either
    yield from (
        name for entry in _items(data, "configuration") for name in _items(entry, "variations")
    )
    for section in _SECTIONS:
        inner = data.get(section)
        for key in _CALLS:
            yield from _items(inner, key)


def _items(data: Any, key: str) -> list[Any]:
    found = data.get(key) if isinstance(data, dict) else None
    return found if isinstance(found, list) else []


def _described(call: Any) -> str | None:
    name, parameters = next(iter(call.items()), ("", 0)) if isinstance(call, dict) else (call, 0)
    if not isinstance(name, str):
        return None
    if name == _SHELL and isinstance(parameters, dict):
        return f"command `{parameters.get('script')}`"
    return f"plugin `{name}`" if split_file_reference(name) else None
