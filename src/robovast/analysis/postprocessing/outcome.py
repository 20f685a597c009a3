"""The outcome of a command: success, a message, and the origin of its files."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

Entry = dict[str, Any]
"""`output`, `sources`, `plugin`, `params`; paths are relative to the campaign."""


@dataclass(frozen=True)
class CommandOutcome:
    """Result of one call of a command."""

    success: bool
    message: str
    entries: list[Entry] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """The outcome as JSON data."""
        return asdict(self)


class NonsenseError(ValueError):
    """A plugin returned an invalid value."""


def read_returned(value: Any, plugin: str, base: Path, campaign: Path) -> CommandOutcome:
    """Validate a plugin's return value.

    Args:
        value: `(success, message)` or `(success, message, entries)`.
        plugin: the plugin's name, for entries without one.
        base: folder that the entries' paths are relative to.
        campaign: folder that the outcome's paths are relative to.

    Raises:
        NonsenseError: the value or an entry is invalid.
    """
    parts = tuple(value) if isinstance(value, tuple | list) else ()
    if len(parts) not in (2, 3) or parts[0] not in (True, False) or not isinstance(parts[1], str):
        raise NonsenseError(
            f"returned {_short(value)}, not `(success, message)` or `(success, message, entries)`"
        )
    entries = read_entries(parts[2] if len(parts) == 3 else [], plugin, base, campaign)
    return CommandOutcome(bool(parts[0]), parts[1].strip(), entries)


def read_entries(value: Any, plugin: str, base: Path, campaign: Path) -> list[Entry]:
    """Validate provenance entries and make their paths relative to the campaign.

    Raises:
        NonsenseError: an entry is invalid, or an output is outside of the campaign.
    """
    if value is None:
        return []
    if not isinstance(value, list | tuple):
        raise NonsenseError(f"its provenance entries are {_short(value)}, not a list")
    return [_entry(item, plugin, base, campaign) for item in value]


def _entry(item: Any, plugin: str, base: Path, campaign: Path) -> Entry:
    if not isinstance(item, dict) or not isinstance(item.get("output"), str | Path):
        raise NonsenseError(f"its provenance entry {_short(item)} names no `output`")
    output = _relative(item["output"], base, campaign)
    if output is None:
        raise NonsenseError(
            f"its provenance entry lists {item['output']}, which is outside of the campaign"
        )
    sources = item.get("sources") or []
    sources = [sources] if isinstance(sources, str | Path) else list(sources)
    return {
        "output": output,
        "sources": [_source(source, base, campaign) for source in sources],
        "plugin": str(item.get("plugin") or plugin),
        "params": item.get("params") or {},
    }


def _source(path: str | Path, base: Path, campaign: Path) -> str:
    """A source's real path: a run's link to its job is followed."""
    real = os.path.realpath(base / path)
    return _relative(real, base, Path(os.path.realpath(campaign))) or str(path)


def _relative(path: str | Path, base: Path, campaign: Path) -> str | None:
    """A path relative to the campaign; None if it is outside."""
    absolute = PurePosixPath(os.path.normpath(base.absolute() / path))
    root = PurePosixPath(os.path.normpath(campaign.absolute()))
    if absolute == root or not absolute.is_relative_to(root):
        return None
    return str(absolute.relative_to(root))


def _short(value: Any) -> str:
    text = repr(value)
    return f"`{text}`" if len(text) <= 80 else f"`{text[:79]}…`"
