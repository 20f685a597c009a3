"""Lists code that a campaign contains, so that users can review it before it is executed."""

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
"""The postprocessing command that executes any program."""


_NAMED = 5
"""Most items that a message names."""


def executables_of(campaign: Path) -> list[str]:
    """Describe the plugin files, postprocessing commands and notebooks of a campaign."""
    config = Layout(campaign).config
    notebooks = (f"notebook `{path.relative_to(config)}`" for path in config.rglob("*.ipynb"))
    calls = (call for path in Layout(campaign).documents for call in _calls(path))
    return sorted({*filter(None, map(_described, calls)), *notebooks})


def warn_of_executables(campaign: Path) -> str | None:
    """A warning for users who imported a campaign; None if it contains no code."""
    found = executables_of(campaign)
    if not found:
        return None
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return (
        f"{campaign.name} contains code that runs with your permissions: "
        f"{', '.join(found[:_NAMED])}{more}. Review it first, or skip it: `vast results "
        "metadata --no-plugins`, `vast evaluation gui --skip-postprocessing`."
    )


def _calls(document: Path) -> Iterator[Any]:
    """Every entry of a document that may name a plugin; entries of other forms cannot."""
    data = read_mapping_leniently(document)  # commands cannot read a damaged one either
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
