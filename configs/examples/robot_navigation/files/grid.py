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

    def with_box(self, x: float, y: float, yaw: float, length: float, width: float) -> Grid:
        """The grid with an obstacle on it."""
        rows, columns = np.indices(self.occupied.shape)
        right, up = self.place(rows, columns)
        along = (right - x) * math.cos(yaw) + (up - y) * math.sin(yaw)
        across = (up - y) * math.cos(yaw) - (right - x) * math.sin(yaw)
        box = (abs(along) <= length / 2) & (abs(across) <= width / 2)
        return Grid(self.occupied | box, self.resolution, self.origin)

    def touches(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc touches the centre of an occupied cell."""
        steps = np.arange(-radius, radius + self.resolution / 2, self.resolution / 2)
        right, up = np.meshgrid(steps, steps)
        disc = right**2 + up**2 <= (radius - self.resolution / 2) ** 2
        return bool(self.is_occupied(x + right[disc], y + up[disc]).any())

    def ranges(self, x: float, y: float, angles, longest: float):
        """How far rays go [m]; infinity where nothing is hit."""
        distance = np.arange(0.0, longest, self.resolution / 2)
        right = x + np.cos(angles)[:, None] * distance
        up = y + np.sin(angles)[:, None] * distance
        hit = self.is_occupied(right, up)
        return np.where(hit.any(axis=1), distance[hit.argmax(axis=1)], np.inf)

    def inflated(self, radius: float):
        """Cells (True) where a disc of this radius would touch something."""
        reach = math.ceil(radius / self.resolution)
        padded = np.pad(self.occupied, reach, constant_values=True)
        height, width = self.occupied.shape
        found = np.zeros_like(self.occupied)
        for up in range(-reach, reach + 1):
            for right in range(-reach, reach + 1):
                if math.hypot(up, right) * self.resolution <= radius:
                    rows = slice(reach + up, reach + up + height)
                    found |= padded[rows, reach + right : reach + right + width]
        return found


def way(blocked, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
    """The shortest way over cells that are not blocked (A*); empty where there is none."""
    best = {start: 0.0}
    before: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(math.dist(start, goal), start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            cells = [here]
            while here != start:
                here = before[here]
                cells.append(here)
            return cells[::-1]
        for up, right in NEIGHBOURS:
            there = here[0] + up, here[1] + right
            cost = best[here] + math.hypot(up, right)
            if not is_blocked(blocked, there) and cost < best.get(there, math.inf):
                best[there], before[there] = cost, here
                heapq.heappush(queue, (cost + math.dist(there, goal), there))
    return []


def is_blocked(blocked, cell: tuple[int, int]) -> bool:
    row, column = cell
    height, width = blocked.shape
    return not (0 <= row < height and 0 <= column < width) or bool(blocked[row, column])
