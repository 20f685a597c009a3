#!/usr/bin/env python3
"""A disc on wheels that drives straight to its goal and stops where something is in its way."""

from __future__ import annotations

import ast
import csv
import math
import re
import sys
from pathlib import Path

STEP = 0.05
"""Distance between two looks at the map [m]."""


def main() -> int:
    """Exit code 0 at the goal, 1 where the way ended."""
    given = options(sys.argv[1:])
    grid = Grid(Path(given["map"]))
    start, goal = (place(ast.literal_eval(given[name])) for name in ("start", "goal"))
    radius = float(given["diameter"]) / 2
    discs = [(place(one["spawn_pose"]), size(one)) for one in ast.literal_eval(given["obstacles"])]
    distance = math.dist(start, goal)
    steps = math.ceil(distance / STEP)
    with (Path(given["output"]) / "drive.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["distance", "x", "y"])
        for step in range(steps + 1):
            part = step / steps if steps else 1.0
            x, y = (a + part * (b - a) for a, b in zip(start, goal, strict=True))
            table.writerow([round(part * distance, 3), round(x, 3), round(y, 3)])
            what = in_the_way((x, y), radius, grid, discs)
            if what:
                print(
                    f"{what} after {part * distance:.2f} of {distance:.2f} m, at {x:.2f}, {y:.2f}"
                )
                return 1
    print(f"at the goal after {distance:.2f} m")
    return 0


def options(words: list[str]) -> dict[str, str]:
    """`--name value value …` by name; a value may be any number of words."""
    found: dict[str, list[str]] = {}
    for word in words:
        if word.startswith("--"):
            found[word[2:]] = values = []
        else:
            values.append(word)
    return {name: " ".join(values) for name, values in found.items()}


def in_the_way(at, radius: float, grid: Grid, discs) -> str:
    """What a disc touches, or nothing."""
    if any(math.dist(at, other) < radius + reach for other, reach in discs):
        return "stopped by an obstacle"
    return "" if grid.is_free(at, radius) else "stopped by a wall"


def place(pose) -> tuple[float, float]:
    return float(pose["position"]["x"]), float(pose["position"]["y"])


def size(obstacle) -> float:
    """Radius of a disc that holds an obstacle [m]."""
    width, length = (
        float(re.search(rf"{key}:=([0-9.]+)", obstacle["xacro_arguments"])[1])
        for key in ("width", "length")
    )
    return math.hypot(width, length) / 2


class Grid:
    """A map as map_server reads it: binary PGM, the darker the more occupied."""

    def __init__(self, path: Path) -> None:
        text = path.read_text()
        self.resolution = float(re.search(r"resolution: ([\d.]+)", text)[1])
        origin = re.search(r"origin:\s*-?\s*\[?\s*([-\d.e]+)[,\s-]*?\s(-?[\d.e]+)", text)
        self.origin = float(origin[1]), float(origin[2])
        data = (path.parent / re.search(r"image: (\S+)", text)[1]).read_bytes()
        width, height = data.split(maxsplit=4)[1:3]
        self.width, self.height = int(width), int(height)
        self.cells = data[-self.width * self.height :]

    def is_free(self, at: tuple[float, float], radius: float) -> bool:
        """True when no occupied cell is nearer than a radius."""
        reach = math.ceil(radius / self.resolution)
        column = math.floor((at[0] - self.origin[0]) / self.resolution)
        row = math.floor((at[1] - self.origin[1]) / self.resolution)
        near = (
            (row + down, column + right)
            for down in range(-reach, reach + 1)
            for right in range(-reach, reach + 1)
            if math.hypot(down, right) * self.resolution < radius - self.resolution
        )
        return all(self.is_cell_free(*cell) for cell in near)

    def is_cell_free(self, row: int, column: int) -> bool:
        if not (0 <= row < self.height and 0 <= column < self.width):
            return False
        return self.cells[(self.height - 1 - row) * self.width + column] > 250


if __name__ == "__main__":
    sys.exit(main())
