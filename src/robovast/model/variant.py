"""A variant: one concrete set of scenario parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class ConfigFile:
    """A file that belongs to one variant."""

    name: str
    """Path relative to the config folder of the container."""
    source: Path
    """Absolute path of the file."""


@dataclass(frozen=True, slots=True)
class VariationRecord:
    """One application of a variation type, for the metadata of the campaign."""

    name: str
    started_at: str
    """ISO 8601, UTC."""
    duration: float
    """[s]"""


@dataclass(frozen=True, slots=True)
class Variant:
    """One concrete set of scenario parameters, and the folder name of its results."""

    name: str
    """Entry name and one index per variation, such as `hall-3-2`."""
    entry: str
    """Name of its configuration entry."""
    parameters: Mapping[str, Any]
    """Scenario parameters that differ from the scenario's defaults."""
    files: tuple[ConfigFile, ...] = ()
    """Files of this variant."""
    variations: tuple[VariationRecord, ...] = ()
    """The variations that were applied, in order."""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Further keys that variation types set; most begin with `_`."""
    factors: Mapping[str, Any] = field(default_factory=dict)
    """What was varied, as `{name: {value, unit}}`; empty if it is just the parameters."""
