"""Maps of many configurations, the ways of their runs, and where these ended."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError, RobovastError
from robovast.campaign.verdict import Verdict
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.drive.ground import Ground, PlannedScene, planned, stored_ground
from robovast.evaluation.map_picture import (
    RECORD,
    MapFiles,
    entries,
    map_records,
    read_map_files,
)
from robovast.evaluation.poses import Place, last_position, rough_way
from robovast.evaluation.summaries import VariantRuns
from robovast.evaluation.untrusted_data import mapping
from robovast.model.naming import is_run_number

_MOST = 60
"""Configurations of one answer."""
_MOST_RUNS = 1000
_MOST_PLACES = 20_000
_MOST_WAYS = 50
"""Most runs of a configuration whose ways are shown; of the others only the end is."""
_PLACES = 60
"""Places that make a way, at most."""


@dataclass(frozen=True)
class ConfigurationMap:
    """A configuration on its map."""

    name: str
    ground: int | None
    """Index of its map; None if it has none."""
    planned: PlannedScene
    ways: list[tuple[int, list[Place]]]
    """Number and approximate way of each run that has a table of poses."""


@dataclass
class Maps:
    """Configurations on their maps."""

    grounds: list[Ground] = field(default_factory=list)
    """Different maps, each once"""
    configurations: list[ConfigurationMap] = field(default_factory=list)


@dataclass
class FailurePlaces:
    """Where the runs of a campaign ended that did not pass."""

    grounds: list[Ground] = field(default_factory=list)
    """Different maps, each once"""
    places: list[tuple[str, int, int | None, float, float]] = field(default_factory=list)
    """Configuration, number of the run, index of the map, x and y [m]; at most 20,000."""


class _Grounds:
    """Different maps; equal ones of many configurations are read once."""

    def __init__(self, results: Path, campaign: str, found: list[Ground]) -> None:
        self._results = results
        self._campaign = campaign
        self._found = found
        self._known: dict[MapFiles, int | None] = {}

    def index(self, variant: str, record: Mapping[str, Any]) -> int | None:
        """Index of the map of a configuration; None if it has none that can be read."""
        if not isinstance(record.get("map_file"), str):
            return None
        try:
            files = read_map_files(self._results, self._campaign, variant, record)
        except InputError:
            return None
        if files not in self._known:
            self._known[files] = self._add(files, variant)
        return self._known[files]

    def _add(self, files: MapFiles, variant: str) -> int | None:
        try:
            self._found.append(stored_ground(files, f"{self._campaign}/{variant}"))
        except RobovastError:
            return None
        return len(self._found) - 1


def failure_places(results: Path, campaign: str, variants: Sequence[VariantRuns]) -> FailurePlaces:
    """Where the runs of a campaign ended that did not pass, as far as tables of poses tell it."""
    bad = [
        (variant.name, run.number)
        for variant in variants
        for run in variant.runs
        if run.verdict in (Verdict.FAILED, Verdict.ERRORED)
    ]
    ends = [
        (name, number, end)
        for name, number in bad[:_MOST_PLACES]
        if (end := last_position(results, f"{campaign}/{name}/{number}"))
    ]
    found = FailurePlaces()
    grounds = _Grounds(results, campaign, found.grounds)
    recorded = map_records(results, campaign, {name for name, _, _ in ends})
    ground_of = {name: grounds.index(name, record) for name, record in recorded.items()}
    found.places = [(name, number, ground_of.get(name), x, y) for name, number, (x, y) in ends]
    return found


def configuration_maps(results: Path, campaign: str, variants: Sequence[str]) -> Maps:
    """Maps of configurations of a campaign, in the order of their names, at most 60."""
    found = Maps()
    grounds = _Grounds(results, campaign, found.grounds)
    recorded = entries(results, campaign, variants[:_MOST])
    for name in variants[:_MOST]:
        entry = recorded.get(name, {})
        record = mapping(entry.get(RECORD))
        found.configurations.append(
            ConfigurationMap(
                name,
                grounds.index(name, record),
                planned(record, mapping(entry.get("config"))),
                _ways(results, f"{campaign}/{name}"),
            )
        )
    return found


def _ways(results: Path, place: str) -> list[tuple[int, list[Place]]]:
    """The ways of those runs of a configuration that have tables of poses."""
    try:
        names = os.listdir(resolved(results, place))
    except (InputError, OSError):
        return []
    numbers = sorted(map(int, filter(is_run_number, names)))[:_MOST_RUNS]
    found = (
        (number, rough_way(results, f"{place}/{number}", _PLACES if i < _MOST_WAYS else 1))
        for i, number in enumerate(numbers)
    )
    return [(number, way) for number, way in found if way]
