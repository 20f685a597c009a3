"""The map, obstacles and goals of a drive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robovast.base.errors import InputError, RobovastError
from robovast.evaluation.map_picture import MapFiles, decode_map, read_map_files
from robovast.navigation.obstacle_boxes import obstacle_boxes
from robovast.navigation.poses import read_pose

_FREE, _UNKNOWN, _WALL = 0, 1, 2
_MOST_CELLS = 16_000_000
_MOST_SHAPES = 2000
_OCCUPIED = 65
"""Share from which a cell counts as occupied [%]."""


@dataclass(frozen=True)
class Ground:
    """A map in runs of equal cells, row by row from the lowest."""

    columns: int
    rows: int
    resolution: float
    """Edge length of a cell [m]"""
    x: float
    """Lower left corner [m]"""
    y: float
    yaw: float
    """[rad]"""
    runs: list[int]
    """Length and kind of each run: 0 free, 1 unknown, 2 wall."""


@dataclass
class PlannedScene:
    """What a configuration was made with."""

    diameter: float | None = None
    """Of the robot [m]"""
    start: list[float] | None = None
    """x, y, yaw [m, rad]"""
    goals: list[list[float]] = field(default_factory=list)
    path: list[list[float]] = field(default_factory=list)
    obstacles: list[list[float]] = field(default_factory=list)
    """x, y, radius, or x, y, yaw, length, width [m, rad]"""


def configured_ground(
    results: Path, campaign: str, variant: str, record: Mapping[str, Any]
) -> tuple[Ground | None, str]:
    """The map of a configuration, of which `record` was recorded; or why there is none."""
    if not isinstance(record.get("map_file"), str):
        return None, "the configuration has none, and none was recorded."
    try:
        files = read_map_files(results, campaign, variant, record)
        return stored_ground(files, f"{campaign}/{variant}"), ""
    except RobovastError as error:
        return None, str(error)


def stored_ground(files: MapFiles, name: str) -> Ground:
    """The map that files hold; `name` is that of its configuration in messages.

    Raises:
        InputError: it cannot be read.
    """
    occupancy = decode_map(files, name)
    cells = np.full(occupancy.free.shape, _UNKNOWN, np.uint8)
    cells[occupancy.free] = _FREE
    cells[occupancy.occupied] = _WALL
    x, y = occupancy.origin
    return _ground(cells, occupancy.resolution, (x, y, 0.0))


def recorded_ground(grid: Any) -> Ground:
    """The map of a nav_msgs/msg/OccupancyGrid.

    Raises:
        InputError: it is too large or invalid.
    """
    info = grid.info
    rows, columns, data = int(info.height), int(info.width), np.asarray(grid.data)
    if rows * columns != len(data) or not 0 < rows * columns <= _MOST_CELLS:
        raise InputError(f"the recorded map of {columns} × {rows} cells cannot be shown")
    origin = info.origin.position.x, info.origin.position.y
    turn = info.origin.orientation
    yaw = 2 * math.atan2(turn.z, turn.w)
    if not (np.isfinite([*origin, yaw, info.resolution]).all() and info.resolution > 0):
        raise InputError("the recorded map has no place or size")
    values = data.reshape(rows, columns)
    cells = np.full(values.shape, _FREE, np.uint8)
    cells[values < 0] = _UNKNOWN
    cells[values >= _OCCUPIED] = _WALL
    return _ground(cells, float(info.resolution), (*origin, yaw))


def _ground(
    cells: NDArray[np.uint8], resolution: float, origin: tuple[float, float, float]
) -> Ground:
    flat = cells.ravel()
    edges = np.flatnonzero(np.diff(flat)) + 1
    begins = np.concatenate(([0], edges))
    lengths = np.diff(np.concatenate((begins, [len(flat)])))
    runs = np.column_stack((lengths, flat[begins])).ravel().tolist()
    rows, columns = cells.shape
    return Ground(columns, rows, resolution, *origin, runs)


def planned(record: Mapping[str, Any], parameters: Mapping[str, Any]) -> PlannedScene:
    """What a configuration was made with; what is invalid is left out.

    Args:
        record: what variations have recorded.
        parameters: its scenario parameters, which tell the shapes of obstacles.
    """
    goals = [pose for pose in map(_pose, _items(record.get("goals"))) if pose]
    return PlannedScene(
        diameter=_number(record.get("robot_diameter")),
        start=_pose(record.get("start")),
        goals=goals,
        path=[point for point in map(_numbers, _items(record.get("path"))) if len(point) == 2],
        obstacles=_obstacles(record, parameters),
    )


def _obstacles(record: Mapping[str, Any], parameters: Mapping[str, Any]) -> list[list[float]]:
    """Boxes where the parameters tell a length and a width, else discs."""
    boxes = obstacle_boxes(parameters)
    found: list[list[float]] = []
    for one in _items(record.get("obstacles")):
        if isinstance(one, dict):
            disc = _numbers([one.get("x"), one.get("y"), one.get("radius")])
            if len(disc) == 3:
                found.append([*boxes.get((disc[0], disc[1]), disc)])
    return found


def _pose(value: Any) -> list[float] | None:
    try:
        pose = read_pose(value)
    except ValueError:
        return None
    return [pose.x, pose.y, pose.yaw]


def _items(value: Any) -> Sequence[Any]:
    return value[:_MOST_SHAPES] if isinstance(value, list) else ()


def _numbers(values: Any) -> list[float]:
    """The values as numbers; empty if one of them is none."""
    found = [_number(value) for value in _items(values)]
    return [one for one in found if one is not None] if None not in found else []


def _number(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None
