"""Plans a way on the map, follows it, and plans again when something is on it."""

from __future__ import annotations

import math

import numpy as np
from grid import Grid, way

AHEAD = 0.35
"""Distance of the point on the way that the robot turns to [m]."""
FASTEST_TURN = 1.5
"""[rad/s]"""


class Pilot:
    """Knows its map, its goal, and what the laser hit so far."""

    def __init__(self, grid: Grid, goal, clearance: float, speed: float) -> None:
        self.grid = Grid(grid.occupied.copy(), grid.resolution, grid.origin)
        self.goal, self.clearance, self.speed = goal, clearance, speed
        self.blocked, self.disc = grid.inflated(clearance), grid.disc(clearance)
        self.walls = grid.inflated(grid.resolution)
        self.way: list[tuple[float, float]] = []

    def plan(self, here, ranges, angles) -> bool:
        """Whether the way changed; it is empty where there is none."""
        self.notice(here, ranges, angles)
        if self.way and not self.is_way_blocked():
            return False
        start, goal = (
            tuple(int(part) for part in self.grid.cell(np.float64(x), np.float64(y)))
            for x, y, _ in (here, self.goal)
        )
        blocked = self.blocked.copy()
        reach = math.ceil(self.clearance / self.grid.resolution)
        around = tuple(
            slice(max(0, at - reach), min(end, at + reach + 1))
            for at, end in zip(start, blocked.shape, strict=True)
        )
        rows, columns = np.ogrid[around]
        near = np.hypot(rows - start[0], columns - start[1]) * self.grid.resolution
        blocked[around][(near < self.clearance) & ~self.grid.occupied[around]] = False
        self.way = [self.grid.place(*cell) for cell in way(blocked, start, goal)]
        return True

    def notice(self, here, ranges, angles) -> None:
        """Put what the laser hit on the grid; beside a wall it is the wall, seen with noise."""
        near = np.isfinite(ranges)
        right = here[0] + ranges[near] * np.cos(here[2] + angles[near])
        up = here[1] + ranges[near] * np.sin(here[2] + angles[near])
        inside = ~self.grid.is_occupied(right, up)
        rows, columns = self.grid.cell(right[inside], up[inside])
        new = ~self.walls[rows, columns]
        if new.any():
            self.grid.occupied[rows[new], columns[new]] = True
            cells = np.column_stack([rows[new], columns[new]])
            around = (cells[:, None] + self.disc).reshape(-1, 2)
            height, width = self.blocked.shape
            inside = ((around >= 0) & (around < (height, width))).all(axis=1)
            self.blocked[tuple(around[inside].T)] = True

    def is_way_blocked(self) -> bool:
        rows, columns = self.grid.cell(*np.array(self.way).T)
        return bool(self.blocked[rows, columns].any())

    def steer(self, here) -> tuple[float, float]:
        """Speed and turn [m/s, rad/s] towards a point ahead; what is behind is forgotten."""
        distances = [math.dist(here[:2], point) for point in self.way]
        self.way = self.way[distances.index(min(distances)) :]
        target = next((p for p in self.way if math.dist(here[:2], p) >= AHEAD), self.way[-1])
        bearing = math.atan2(target[1] - here[1], target[0] - here[0])
        error = math.remainder(bearing - here[2], math.tau)
        turn = max(-FASTEST_TURN, min(FASTEST_TURN, 2 * error))
        return self.speed * max(0.0, math.cos(error)) ** 2, turn
