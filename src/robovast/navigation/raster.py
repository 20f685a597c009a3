"""Finds paths between the points of a raster."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from robovast.navigation.costmap import LATTICE_EXCESS, Costmap
from robovast.navigation.paths import Draft, NoPathError, Path, Wish, finished, require_passable
from robovast.navigation.poses import Point, length_of

MOST_PATHS = 5_000
"""Most paths; finding more takes minutes, and no campaign needs them."""


@dataclass(frozen=True)
class Raster:
    """Points at equal distances from the map's origin that the robot can reach."""

    size: float
    """[m]"""
    offset: Point = (0.0, 0.0)
    """Offset from the map's lower left corner [m]."""

    def points(self, costmap: Costmap) -> list[Point]:
        """The points row by row from the lowest, each row from left to right."""
        x0, x1, y0, y1 = costmap.map.extent
        found = [
            (x, y)
            for y in _steps(y0 + self.offset[1], y0, y1, self.size)
            for x in _steps(x0 + self.offset[0], x0, x1, self.size)
        ]
        return [point for point in found if costmap.is_passable(point)]


def _steps(anchor: float, low: float, high: float, size: float) -> list[float]:
    """The values `anchor + n × size` between two limits."""
    first = anchor - (anchor - low) // size * size
    return [first + number * size for number in range(int((high - first) // size) + 1)]


def raster_paths(costmap: Costmap, raster: Raster, wish: Wish) -> Iterator[Path]:
    """All paths over points of a raster that meet the requirements.

    They start at the given start, or at any of the points.

    Raises:
        NoPathError: there is no path, or there are more than MOST_PATHS.
    """
    require_passable(costmap, wish)
    points = raster.points(costmap)
    legs = _Legs(costmap, wish.length + wish.tolerance)
    count = 0
    for start in [wish.start.point] if wish.start else points:
        for draft in _drafts(legs, points, Draft([start]), wish):
            count += 1
            if count > MOST_PATHS:
                raise NoPathError(
                    f"a grid of {raster.size:g} m gives more than {MOST_PATHS} paths; use a wider "
                    "grid, fewer goals or one start"
                )
            yield finished(draft, wish.start)
    if not count:
        raise NoPathError(
            f"no path of {wish.length:g} m (± {wish.tolerance:g} m) connects the {len(points)} "
            f"grid points that a robot of {2 * costmap.radius:g} m can reach (grid of "
            f"{raster.size:g} m). Use a finer grid or another length"
        )


def _drafts(legs: _Legs, points: Sequence[Point], draft: Draft, wish: Wish) -> Iterator[Draft]:
    """All completions of a draft."""
    missing = wish.goals + 1 - len(draft.stops)
    if not missing:
        yield draft
        return
    least = wish.length - wish.tolerance - draft.length if missing == 1 else 0.0
    most = wish.length + wish.tolerance - draft.length
    for point in points:
        if point not in draft.stops:
            way = legs.between(draft.stops[-1], point, least, most)
            if way is not None:
                yield from _drafts(legs, points, draft.extended(way), wish)


class _Legs:
    """Shortest paths between points up to a length limit [m]."""

    def __init__(self, costmap: Costmap, limit: float) -> None:
        self._costmap = costmap
        self._limit = limit * LATTICE_EXCESS
        self._node = cache(costmap.lattice.node_near)
        self._straightened = cache(self._straighten)

    def between(self, a: Point, b: Point, least: float, most: float) -> list[Point] | None:
        """The path, if its length is between two limits [m]."""
        if math.dist(a, b) > most:
            return None
        first, last = self._node(a), self._node(b)
        if first is None or last is None:
            return None
        ways = self._costmap.lattice.ways_from(first, self._limit)
        if not least <= ways.lengths[last] <= most * LATTICE_EXCESS:
            return None
        way = self._straightened(a, first, last, b)
        return way if least <= length_of(way) <= most else None

    def _straighten(self, a: Point, first: int, last: int, b: Point) -> list[Point]:
        ways = self._costmap.lattice.ways_from(first, self._limit)
        return self._costmap.straightened([a, *ways.points_to(last), b])
