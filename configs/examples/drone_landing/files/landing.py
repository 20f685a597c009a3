"""A drone comes down from 10 m among gusts; it may land too fast, too far away, or never."""

import argparse
import csv
import os
import random
import sys
from collections import deque
from pathlib import Path

STEP, LIMIT = 0.02, 30.0
FASTEST, FARTHEST = 1.2, 1.5  # m/s, m


def fly(
    given: argparse.Namespace, chance: random.Random
) -> list[tuple[float, float, float, float]]:
    """Rows of time, height, vertical speed, distance aside."""
    height, speed, aside, drift, gust = 10.0, 0.0, 0.0, 0.0, 0.0
    seen = deque([0.0] * (1 + round(given.delay / STEP)), maxlen=1 + round(given.delay / STEP))
    rows = []
    while height > 0.0 and len(rows) * STEP < LIMIT:
        rows.append((round(len(rows) * STEP, 2), height, speed, aside))
        seen.append(speed)
        wanted = -min(max(0.5 * height, 0.4), 2.0)
        thrust = min(max(9.81 + given.gain * (wanted - seen[0]), 0.0), 18.0)
        gust += STEP * -0.8 * gust + STEP**0.5 * given.gust * chance.gauss(0.0, 1.0)
        speed += STEP * (thrust / given.mass - 9.81 + 0.5 * gust)
        drift += STEP * (gust - 1.5 * aside - 1.2 * drift)
        aside += STEP * drift
        height += STEP * speed
    return [*rows, (round(len(rows) * STEP, 2), max(height, 0.0), speed, aside)]


def main() -> int:
    parser = argparse.ArgumentParser()
    for name in ("mass", "gain", "delay", "gust"):
        parser.add_argument(f"--{name}", type=float)
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    rows = fly(given, random.Random(os.environ.get("ROBOVAST_SEED")))  # noqa: S311
    with (given.output / "trajectory.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("time", "height", "speed", "aside"), *rows])
    _, height, speed, aside = rows[-1]
    return int(height > 0.0 or speed < -FASTEST or abs(aside) > FARTHEST)


if __name__ == "__main__":
    sys.exit(main())
