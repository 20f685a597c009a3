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
    """Knows its map, its goal, and what the laser hit so far, or in the last `memory` steps."""

    def __init__(
        self, grid: Grid, goal, clearance: float, speed: float, memory: float = math.inf
    ) -> None:
        self.map, self.memory, self.steps = grid, memory, 0
        self.seen = np.full(grid.occupied.shape, -np.inf)
        self.grid = Grid(grid.occupied.copy(), grid.resolution, grid.origin)
        self.goal, self.clearance, self.speed = goal, clearance, speed
        self.known, self.disc = grid.inflated(clearance), grid.disc(clearance)
        self.blocked = self.known.copy()
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
        if self.memory < math.inf:
            self.forget()
        known = self.grid if self.memory == math.inf else self.map
        inside = ~known.is_occupied(right, up)
        rows, columns = self.grid.cell(right[inside], up[inside])
        new = ~self.walls[rows, columns]
        if new.any():
            self.seen[rows[new], columns[new]] = self.steps
            self.block(rows[new], columns[new])

    def forget(self) -> None:
        """Leave on the grid what the map shows and what was seen lately."""
        self.steps += 1
        self.grid.occupied, self.blocked = self.map.occupied.copy(), self.known.copy()
        self.block(*np.nonzero(self.seen > self.steps - self.memory))

    def block(self, rows, columns) -> None:
        """Put cells on the grid, and keep off them."""
        self.grid.occupied[rows, columns] = True
        around = (np.column_stack([rows, columns])[:, None] + self.disc).reshape(-1, 2)
        inside = ((around >= 0) & (around < self.blocked.shape)).all(axis=1)
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
