"""Maps of many configurations, and where their runs ended."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robovast.base.errors import InputError
from robovast.evaluation.drive.ground import Ground, Planned, configured_ground, planned
from robovast.evaluation.inside import open_inside, resolved
from robovast.evaluation.map_picture import RECORD, entries
from robovast.evaluation.untrusted import mapping

_MOST = 60
"""Configurations of one answer."""
_MOST_RUNS = 1000
_TABLE = "poses.csv"
_END = 4096
"""Last bytes of a table that are read."""


@dataclass(frozen=True)
class ConfigurationMap:
    """A configuration on its map."""

    name: str
    ground: int | None
    """Index of its map; None if it has none."""
    planned: Planned
    ends: list[tuple[int, float, float]]
    """Number of each run whose table of poses tells it, and where it ended [m]."""


@dataclass
class Maps:
    """Configurations on their maps."""

    grounds: list[Ground] = field(default_factory=list)
    """Different maps, each once"""
    configurations: list[ConfigurationMap] = field(default_factory=list)


def configuration_maps(results: Path, campaign: str, variants: Sequence[str]) -> Maps:
    """Maps of configurations of a campaign, in the order of their names, at most 60."""
    found = Maps()
    recorded = entries(results, campaign, variants[:_MOST])
    for name in variants[:_MOST]:
        entry = recorded.get(name, {})
        record = mapping(entry.get(RECORD))
        ground, _ = configured_ground(results, campaign, name, record)
        if ground is not None and ground not in found.grounds:
            found.grounds.append(ground)
        found.configurations.append(
            ConfigurationMap(
                name,
                None if ground is None else found.grounds.index(ground),
                planned(record, mapping(entry.get("config"))),
                _ends(results, f"{campaign}/{name}"),
            )
        )
    return found


def _ends(results: Path, place: str) -> list[tuple[int, float, float]]:
    """Where the runs of a configuration ended, as far as tables of poses tell it."""
    try:
        names = os.listdir(resolved(results, place))
    except (InputError, OSError):
        return []
    numbers = sorted(int(name) for name in names if name.isdecimal())
    ends = ((number, _last_position(results, f"{place}/{number}")) for number in numbers)
    return [(number, *end) for number, end in list(ends)[:_MOST_RUNS] if end is not None]


def _last_position(results: Path, run: str) -> tuple[float, float] | None:
    try:
        with open_inside(results, f"{run}/{_TABLE}") as file:
            head = file.readline(_END).decode("utf-8", "replace")
            begin = file.tell()
            file.seek(max(begin, os.fstat(file.fileno()).st_size - _END))
            rows = file.read(_END).decode("utf-8", "replace").splitlines()
        names, row = csv.reader([head, rows[-1]])
        at = dict(zip(names, row, strict=True))
        return round(float(at["position.x"]), 3), round(float(at["position.y"]), 3)
    except (InputError, ValueError, LookupError, csv.Error):
        return None
