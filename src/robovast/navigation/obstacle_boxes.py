"""The boxes among obstacles, as the parameters tell them to the simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robovast.navigation.poses import Point, read_pose

MOST = 2000
"""Most obstacles of one parameter that are looked at."""

Box = tuple[float, float, float, float, float]
"""x, y, yaw, length, width [m, rad]"""


def obstacle_boxes(parameters: Mapping[str, Any]) -> dict[Point, Box]:
    """The obstacles with a length and a width among scenario parameters, by place.

    What is invalid is left out. An obstacle of the records that is not here is a disc.
    """
    lists = (value[:MOST] for value in parameters.values() if isinstance(value, list))
    found = (_box(item) for items in lists for item in items if isinstance(item, dict))
    return {(box[0], box[1]): box for box in found if box is not None}


def corners(box: Box) -> list[Point]:
    """The corners of a box on the map, in order."""
    x, y, yaw, length, width = box
    cos, sin = math.cos(yaw), math.sin(yaw)
    ends = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    sides = ((a * length / 2, b * width / 2) for a, b in ends)
    return [(x + u * cos - v * sin, y + u * sin + v * cos) for u, v in sides]


def _box(obstacle: Mapping[str, Any]) -> Box | None:
    words = str(obstacle.get("xacro_arguments") or "").replace(",", " ").split()
    given = dict(word.split(":=", 1) for word in words if ":=" in word)
    try:
        pose = read_pose(obstacle.get("spawn_pose"))
        box = (pose.x, pose.y, pose.yaw, float(given["length"]), float(given["width"]))
    except (KeyError, ValueError):
        return None
    return box if all(map(math.isfinite, box)) else None
