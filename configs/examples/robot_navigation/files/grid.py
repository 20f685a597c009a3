"""Occupancy grids: reading, obstacles, rays, distances, ways. Rows go up, as in OccupancyGrid."""

from __future__ import annotations

import heapq
import math
import re
from pathlib import Path

import numpy as np
import yaml

NEIGHBOURS = [(up, right) for up in (-1, 0, 1) for right in (-1, 0, 1) if up or right]


class Grid:
    """Which cells of a map are occupied (True), and where they are."""

    def __init__(self, occupied, resolution: float, origin: tuple[float, float]) -> None:
        self.occupied = occupied
        self.resolution = resolution
        self.origin = origin

    @classmethod
    def read(cls, path: Path) -> Grid:
        """A map as map_server reads it (binary PGM); what is not known to be free is occupied."""
        told = yaml.safe_load(path.read_text())
        data = (path.parent / told["image"]).read_bytes()
        header = re.match(rb"P5\s+(?:#.*\n)?(\d+)\s+(\d+)\s+255\s", data)
        width, height = int(header[1]), int(header[2])
        image = np.frombuffer(data, np.uint8, offset=header.end()).reshape(height, width)
        free = (255 - image) / 255 < told["free_thresh"]
        return cls(~free[::-1], told["resolution"], tuple(told["origin"][:2]))

    def cell(self, x, y):
        """Row and column of a place [m]; of arrays too."""
        column = np.floor((x - self.origin[0]) / self.resolution).astype(int)
        row = np.floor((y - self.origin[1]) / self.resolution).astype(int)
        return row, column

    def place(self, row: int, column: int) -> tuple[float, float]:
        """The centre of a cell [m]."""
        return (
            self.origin[0] + (column + 0.5) * self.resolution,
            self.origin[1] + (row + 0.5) * self.resolution,
        )

    def is_occupied(self, x, y):
        """Of places [m]; what is outside of the map is occupied."""
        row, column = self.cell(x, y)
        height, width = self.occupied.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        return ~inside | self.occupied[row.clip(0, height - 1), column.clip(0, width - 1)]

    def clearance(self, x: float, y: float) -> float:
        """Return the distance from a place to the nearest occupied cell [m]."""
        rows, columns = np.nonzero(self.occupied)
        offsets = np.subtract(self.place(rows, columns), [[x], [y]])
        outside = np.maximum(np.abs(offsets) - self.resolution / 2, 0.0)
        return float(np.hypot(*outside).min(initial=math.inf))

    def rectangles(self) -> list[tuple[int, int, int, int]]:
        """First row and column, last row and column of few rectangles that are all occupied cells.

        Each takes the widest run that is left in a row, then all rows above that have it too.
        """
        left, found = self.occupied.copy(), []
        while left.any():
            row, column = np.argwhere(left)[0]
            wide = run(left[row, column:])
            tall = run(left[row:, column : column + wide].all(axis=1))
            left[row : row + tall, column : column + wide] = False
            found.append((row, column, row + tall - 1, column + wide - 1))
        return found

    def inflated(self, radius: float):
        """Cells (True) where a disc of this radius would touch something."""
        reach = math.ceil(radius / self.resolution + 0.5)
        padded = np.pad(self.occupied, reach, constant_values=True)
        height, width = self.occupied.shape
        found = np.zeros_like(self.occupied)
        for up, right in self.disc(radius):
            rows = slice(reach + up, reach + up + height)
            found |= padded[rows, reach + right : reach + right + width]
        return found

    def disc(self, radius: float):
        """Offsets of the cells [row, column] of which a disc in this one may touch something."""
        cells = radius / self.resolution + 0.5
        reach = math.ceil(cells)
        offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
        return offsets[np.hypot(*offsets.T) <= cells]


def run(cells) -> int:
    """How many are True from the first one on."""
    return len(cells) if cells.all() else int(np.argmin(cells))


def way(blocked, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
    """The shortest way over cells that are not blocked (A*); empty where there is none."""
    width = blocked.shape[1] + 2  # a border of blocked cells; cells are numbers from here on
    free = (~np.pad(blocked, 1, constant_values=True)).ravel().tolist()
    steps = [(up * width + right, math.hypot(up, right)) for up, right in NEIGHBOURS]
    first, last = ((row + 1) * width + column + 1 for row, column in (start, goal))
    best, expanded, before = [math.inf] * len(free), [math.inf] * len(free), {first: first}
    best[first] = 0.0
    queue = [(math.dist(start, goal), first)]
    while queue:
        _, here = heapq.heappop(queue)
        cost = best[here]
        if here == last:
            return traced(before, last, width)
        if expanded[here] == cost:
            continue  # a shorter way to it was found while it was in the queue
        expanded[here] = cost
        for step, length in steps:
            there = here + step
            if free[there] and cost + length < best[there]:
                best[there], before[there] = cost + length, here
                row, column = divmod(there, width)
                rest = math.hypot(row - 1 - goal[0], column - 1 - goal[1])
                heapq.heappush(queue, (cost + length + rest, there))
    return []


def traced(before: dict[int, int], last: int, width: int) -> list[tuple[int, int]]:
    """Rows and columns from the first cell, which is before itself, to the last one."""
    cells = [last]
    while before[cells[-1]] != cells[-1]:
        cells.append(before[cells[-1]])
    return [(cell // width - 1, cell % width - 1) for cell in reversed(cells)]
