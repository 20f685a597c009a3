"""Where a circular robot can be, and the shortest paths between places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from robovast.base.errors import InputError
from robovast.navigation.occupancy import Mask, OccupancyMap, read_map
from robovast.navigation.poses import Point

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MOST_NODES = 12_000
"""Most nodes of a lattice over the whole map; shortest paths then take a few milliseconds."""

_MOST_POSSIBLE = 4_000_000
"""Nodes of a lattice that needs less than 5 GB."""

WIDEST_SPACING = 0.25
"""Largest distance between lattice nodes [m]; doors are wider, even minus a robot's width."""

LATTICE_EXCESS = 1.03
"""Largest ratio of a path on the lattice to a straight one (1.027)."""

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
_EIGHT = np.ones((3, 3), bool)


class Costmap:
    """A map that is inflated by the radius of a robot.

    Args:
        occupancy: the map; unknown cells and the outside count as occupied.
        robot_diameter: [m]
        clearance: distance from each cell's centre to the nearest obstacle [m]; by default
            computed.
    """

    def __init__(
        self, occupancy: OccupancyMap, robot_diameter: float, clearance: Floats | None = None
    ) -> None:
        self.map = occupancy
        self.radius = robot_diameter / 2
        self.clearance: Floats = _clearance(occupancy) if clearance is None else clearance
        """Distance from each cell's centre to the nearest obstacle [m]."""
        self.passable: Mask = occupancy.free & (self.clearance >= self.radius)
        """Cells where the robot's centre can be."""

    def without(self, discs: list[tuple[Point, float]]) -> Costmap:
        """This costmap with additional circular obstacles, given by centre and radius [m]."""
        rows, columns = np.indices(self.map.free.shape)
        clearance = self.clearance
        for point, radius in discs:
            row, column = self.map.cell(point)
            distance = np.hypot(rows - row, columns - column) * self.map.resolution
            clearance = np.minimum(clearance, distance - radius)
        return Costmap(self.map, 2 * self.radius, clearance)

    def clearance_at(self, point: Point) -> float:
        """Distance to the nearest obstacle [m]; 0 within obstacles and outside the map."""
        row, column = (round(value) for value in self.map.cell(point))
        rows, columns = self.clearance.shape
        if 0 <= row < rows and 0 <= column < columns:
            return float(self.clearance[row, column])
        return 0.0

    def is_passable(self, point: Point) -> bool:
        """Whether the robot's centre can be at a point."""
        return self.sees(point, point)

    def sees(self, a: Point, b: Point) -> bool:
        """Whether the robot can move in a straight line from one point to another."""
        (row_a, column_a), (row_b, column_b) = self.map.cell(a), self.map.cell(b)
        height, width = self.passable.shape
        if min(row_a, row_b, column_a, column_b) < -0.5:
            return False
        if max(row_a, row_b) >= height - 0.5 or max(column_a, column_b) >= width - 0.5:
            return False
        parts = _parts(2 * math.ceil(max(abs(row_b - row_a), abs(column_b - column_a))) + 1)
        rows = (parts * (row_b - row_a) + (row_a + 0.5)).astype(np.intp)
        columns = (parts * (column_b - column_a) + (column_a + 0.5)).astype(np.intp)
        return bool(self.passable[rows, columns].all())

    def shortest_path(self, start: Point, goal: Point) -> list[Point] | None:
        """The shortest path between two passable points, including both; None if there is none."""
        if self.sees(start, goal):
            return [start, goal]
        if self._part_at(start) != self._part_at(goal):
            return None
        for lattice in (self.lattice, self.finest):
            first, last = lattice.node_near(start), lattice.node_near(goal)
            if first is not None and last is not None:
                ways = lattice.ways_from(first)
                if np.isfinite(ways.lengths[last]):
                    return self.straightened([start, *ways.points_to(last), goal])
        return None

    def straightened(self, points: list[Point]) -> list[Point]:
        """A path without the detours of a lattice: it turns only at corners."""
        for _ in range(2):  # once from each end
            points = list(self._taut(points))[::-1]
        return points

    def _taut(self, points: list[Point]) -> Iterator[Point]:
        yield points[0]
        anchor = 0
        for index in range(2, len(points)):
            if not self.sees(points[anchor], points[index]):
                anchor = index - 1
                yield points[anchor]
        yield points[-1]

    @cached_property
    def parts(self) -> tuple[npt.NDArray[np.int32], int]:
        """For each cell its connected component, numbered from 1; and the number of components."""
        return ndimage.label(self.passable, _EIGHT)  # type: ignore[no-any-return]

    def _part_at(self, point: Point) -> int:
        row, column = (round(value) for value in self.map.cell(point))
        return int(self.parts[0][row, column])

    @cached_property
    def finest(self) -> Lattice:
        """The lattice with a node in every passable cell."""
        return Lattice(self, 1)

    @cached_property
    def lattice(self) -> Lattice:
        """A lattice of about MOST_NODES nodes, or more if needed to represent all passages."""
        stride = math.ceil(math.sqrt(self.passable.size / MOST_NODES))
        stride = min(stride, int(WIDEST_SPACING / self.map.resolution))
        while stride > 1:
            lattice = Lattice(self, stride)
            if lattice.is_faithful:
                return lattice
            stride //= 2
        return self.finest


@dataclass(frozen=True)
class Ways:
    """Shortest paths from one node of a lattice to all others."""

    lattice: Lattice
    lengths: Floats
    """Length by node [m]; infinite if there is no path."""
    _before: npt.NDArray[np.int32]

    def points_to(self, node: int) -> list[Point]:
        """The path to a node, including both ends."""
        found = []
        while node >= 0:
            found.append(self.lattice.points[node])
            node = int(self._before[node])
        return found[::-1]


class Lattice:
    """A graph on every n-th passable cell whose edges are straight lines that the robot can take.

    Each node has up to 16 neighbours, so paths are at most 2.7 % longer than without the lattice.

    Raises:
        InputError: it would have more nodes than memory can hold.
    """

    def __init__(self, costmap: Costmap, stride: int) -> None:
        self._costmap = costmap
        self._stride = stride
        self._offset = stride // 2
        there = costmap.passable[self._offset :: stride, self._offset :: stride]
        count = int(np.count_nonzero(there))
        if count > _MOST_POSSIBLE:
            raise InputError(
                f"a path through this map leads through one of {count:,} free cells; at most "
                f"{_MOST_POSSIBLE:,} can be searched",
                hint="use a map with larger cells, or a part of it",
            )
        self._nodes: Ints = np.full(there.shape, -1, np.int64)
        self._nodes[there] = np.arange(count)
        rows, columns = np.nonzero(there)
        self._rows = rows * stride + self._offset
        self._columns = columns * stride + self._offset
        self._graph = self._edges(len(rows))

    @cached_property
    def points(self) -> list[Point]:
        """The position of every node."""
        x, y = self._costmap.map.point(self._rows, self._columns)  # type: ignore[arg-type]
        return list(zip(np.asarray(x).tolist(), np.asarray(y).tolist(), strict=True))

    @cached_property
    def places(self) -> Floats:
        """The position of every node, shape (nodes, 2) [m]."""
        return np.array(self.points, np.float64).reshape(-1, 2)

    @cached_property
    def components(self) -> npt.NDArray[np.int32]:
        """For each node the number of its connected component."""
        return connected_components(self._graph, directed=False)[1]  # type: ignore[no-any-return]

    @cached_property
    def is_faithful(self) -> bool:
        """False if a part of the map is divided or missing."""
        labels, count = self._costmap.parts
        cells = np.bincount(labels.ravel(), minlength=count + 1)
        owner = labels[self._rows, self._columns]
        nodes = np.bincount(owner, minlength=count + 1)
        largest = np.zeros(count + 1, np.int64)
        sizes = np.bincount(self.components)
        np.maximum.at(largest, owner, sizes[self.components])
        torn = (cells >= 16 * self._stride**2) & (largest <= 0.98 * nodes)
        return not bool(torn[1:].any())

    def node_near(self, point: Point) -> int | None:
        """The nearest node that the robot can reach from a point in a straight line."""
        if not len(self.places):
            return None
        distances = np.hypot(*(self.places - point).T)
        reach = 3 * self._stride * self._costmap.map.resolution
        near = np.flatnonzero(distances <= reach)
        for node in near[np.argsort(distances[near])]:
            if self._costmap.sees(point, self.points[node]):
                return int(node)
        return None

    @lru_cache(maxsize=16)  # noqa: B019  # costmaps are few, and cached too
    def ways_from(self, node: int, limit: float = math.inf) -> Ways:
        """Shortest paths from a node up to a length limit [m]."""
        lengths, before = dijkstra(self._graph, indices=node, limit=limit, return_predecessors=True)
        return Ways(self, lengths, before)

    def _edges(self, nodes: int) -> csr_matrix:
        parts = [self._edges_along(step) for step in _STEPS]
        first = np.concatenate([part[0] for part in parts])
        second = np.concatenate([part[1] for part in parts])
        length = np.concatenate([part[2] for part in parts])
        ends = (np.concatenate([first, second]), np.concatenate([second, first]))
        return csr_matrix((np.concatenate([length, length]), ends), shape=(nodes, nodes))

    def _edges_along(self, step: tuple[int, int]) -> tuple[Ints, Ints, Floats]:
        """Nodes that a step connects, and the length of the edge."""
        down, right = step
        rows, columns = self._nodes.shape
        left = max(0, -right)
        here = self._nodes[: rows - down or None, left : columns - max(0, right)]
        there = self._nodes[down:, max(0, right) : columns - left]
        if not here.size or not there.size:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        found = (here >= 0) & (there >= 0)
        first, second = here[found], there[found]
        clear = np.ones(len(first), bool)
        span = 2 * self._stride * max(abs(down), abs(right))
        for part in np.linspace(0, 1, span + 1)[1:-1]:
            row = self._rows[first] + round(part * down * self._stride)
            column = self._columns[first] + round(part * right * self._stride)
            clear &= self._costmap.passable[row, column]
        length = math.hypot(down, right) * self._stride * self._costmap.map.resolution
        return first[clear], second[clear], np.full(int(clear.sum()), length)


@lru_cache(maxsize=256)
def _parts(count: int) -> Floats:
    """Numbers from 0 to 1 at equal distances."""
    return np.linspace(0.0, 1.0, count)


def _clearance(occupancy: OccupancyMap) -> Floats:
    cells = ndimage.distance_transform_edt(np.pad(occupancy.free, 1))[1:-1, 1:-1]
    clearance: Floats = np.maximum(cells - 0.5, 0.0) * occupancy.resolution
    return clearance


def read_costmap(path: Path, robot_diameter: float) -> Costmap:
    """The costmap of a map file; cached until the file changes.

    Raises:
        InputError: the map cannot be read.
    """
    changed = path.stat().st_mtime_ns if path.is_file() else 0
    return _read_costmap(path, changed, robot_diameter)


@lru_cache(maxsize=8)
def _read_costmap(path: Path, changed: int, robot_diameter: float) -> Costmap:
    del changed
    return Costmap(read_map(path), robot_diameter)
