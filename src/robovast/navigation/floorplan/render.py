"""The occupancy map of a floor plan."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from robovast.base.errors import InputError
from robovast.navigation.floorplan.layout import PlacedFloorPlan
from robovast.navigation.map_files import MOST_CELLS
from robovast.navigation.occupancy import Mask, OccupancyMap

RESOLUTION = 0.05
"""Edge length of a cell [m]."""

_MARGIN = 1.25
"""Width of the unknown margin around the plan [m]."""


def render(layout: PlacedFloorPlan, resolution: float = RESOLUTION) -> OccupancyMap:
    """The map that a robot with a laser near the floor would make of a floor plan.

    Rooms and doorways are free; walls, columns, dividers and windows are occupied; the outside is
    unknown. A wall that is thinner than a cell still occupies one.
    """
    ways = shapely.union_all([o.footprint for o in layout.openings if o.is_way])
    walls = shapely.union_all([room.solid for room in layout.rooms]).difference(ways)
    solid = shapely.union_all([walls, *(placed.solid for placed in layout.features)])
    floor = shapely.union_all([ways, *(room.floor for room in layout.rooms)])
    thick = solid.buffer(-resolution / 2, join_style="mitre").buffer(
        resolution / 2, join_style="mitre"
    )
    solid = solid.union(solid.difference(thick).buffer(resolution / 2, join_style="mitre"))

    x0, y0, x1, y1 = floor.union(solid).bounds
    origin = (_down(x0 - _MARGIN, resolution), _down(y0 - _MARGIN, resolution))
    shape = (
        math.ceil((y1 + _MARGIN - origin[1]) / resolution),
        math.ceil((x1 + _MARGIN - origin[0]) / resolution),
    )
    if shape[0] * shape[1] > MOST_CELLS:
        raise InputError(
            f"the map of the floor plan would have {shape[0] * shape[1]:,} cells, more than "
            f"{MOST_CELLS:,}",
            hint="use a coarser resolution, or a smaller plan",
        )
    occupied = fill(solid, shape, resolution, origin)
    free = fill(floor, shape, resolution, origin) & ~occupied
    return OccupancyMap(free, occupied, resolution, origin)


def fill(
    area: BaseGeometry, shape: tuple[int, int], resolution: float, origin: tuple[float, float]
) -> Mask:
    """The cells whose centre is in an area: along each row it begins and ends at its edges."""
    crossings = np.zeros((shape[0], shape[1] + 1), np.int64)
    for ring in rings(area):
        for (xa, ya), (xb, yb) in pairwise(ring):
            low, high = sorted((ya, yb))
            first = max(math.ceil((low - origin[1]) / resolution - 0.5), 0)
            last = min(math.ceil((high - origin[1]) / resolution - 0.5), shape[0])
            rows = np.arange(first, last)
            y = origin[1] + (rows + 0.5) * resolution
            x = xa + (y - ya) * ((xb - xa) / (yb - ya)) if rows.size else y
            columns = np.ceil((x - origin[0]) / resolution - 0.5).astype(np.int64)
            crossings[rows, np.clip(columns, 0, shape[1])] += 1
    filled: Mask = np.cumsum(crossings, axis=1)[:, :-1] % 2 == 1
    return filled


def rings(area: BaseGeometry) -> list[list[tuple[float, float]]]:
    """Outer and inner rings of an area, all closed."""
    polygons = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    rings = [ring for polygon in polygons for ring in (polygon.exterior, *polygon.interiors)]
    return [list(ring.coords) for ring in rings]


def _down(value: float, step: float) -> float:
    """A value rounded down to a multiple of a step."""
    return round(math.floor(value / step) * step, 9)
