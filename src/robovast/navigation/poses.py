"""Poses in the plane, and their form as scenario parameters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Point = tuple[float, float]
"""x and y [m]."""


@dataclass(frozen=True)
class Pose:
    """A position and a heading in the map frame."""

    x: float
    """[m]"""
    y: float
    """[m]"""
    yaw: float = 0.0
    """[rad]"""

    @property
    def point(self) -> Point:
        """The position."""
        return self.x, self.y

    def parameter(self) -> dict[str, dict[str, float]]:
        """The value of a scenario parameter of type `pose_3d`, rounded to 0.1 mm."""
        return {
            "position": position(self.point),
            "orientation": {"roll": 0.0, "pitch": 0.0, "yaw": round(self.yaw, 4)},
        }


def position(point: Point) -> dict[str, float]:
    """The value of a scenario parameter of type `position_3d`."""
    return {"x": round(point[0], 4), "y": round(point[1], 4), "z": 0.0}


def read_pose(value: Any) -> Pose:
    """Parse a pose written as `{x, y, yaw}` or as `{position: {x, y}, orientation: {yaw}}`.

    Raises:
        ValueError: the value has neither form.
    """
    if isinstance(value, Mapping):
        place = value.get("position", value)
        heading = value.get("orientation", value) if "position" in value else value
        if isinstance(place, Mapping) and isinstance(heading, Mapping):
            numbers = [place.get("x"), place.get("y"), heading.get("yaw", 0.0)]
            if all(_is_number(number) for number in numbers):
                return Pose(*map(float, numbers))
    raise ValueError(
        f"{value!r} is not a valid pose: write `{{x: 1.0, y: 2.0, yaw: 0.0}}` in meters and "
        "radians, or `{position: {x: 1.0, y: 2.0}, orientation: {yaw: 0.0}}`"
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def heading(origin: Point, target: Point) -> float:
    """Direction from one point to another [rad]; 0 if they are equal."""
    return math.atan2(target[1] - origin[1], target[0] - origin[0])


def length_of(points: list[Point]) -> float:
    """Length of a polyline [m]."""
    return sum(math.dist(a, b) for a, b in itertools.pairwise(points))
