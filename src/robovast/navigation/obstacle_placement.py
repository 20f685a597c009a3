"""Places obstacles near a path such that the robot can still pass."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robovast.navigation.costmap import Costmap
from robovast.navigation.poses import Point, Pose

ATTEMPTS = 50
"""Most attempts to place all obstacles of a configuration."""

_PLACES_PER_OBSTACLE = 40


class PlacingError(ValueError):
    """Obstacles cannot be placed as requested."""


@dataclass(frozen=True)
class ObstacleKind:
    """Obstacles of one kind."""

    amount: int
    radius: float
    """Radius of a disc around the obstacle [m]."""
    max_distance: float | None
    """Largest distance from the path [m]; None means anywhere."""


@dataclass(frozen=True)
class Course:
    """The robot's path."""

    points: tuple[Point, ...]
    """Corners of the path; empty if there is none."""
    stops: tuple[Point, ...]
    """Start and goals, which must stay clear."""
    skip: float = 0.0
    """Length of the path's beginning without obstacles [m]."""


@dataclass(frozen=True)
class Placed:
    """An obstacle with its position."""

    kind: ObstacleKind
    pose: Pose


def place(
    costmap: Costmap, rng: random.Random, course: Course, kinds: Sequence[ObstacleKind]
) -> list[Placed]:
    """Place obstacles in free space, apart from one another, leaving a path to every goal.

    Equal generators give equal obstacles.

    Raises:
        PlacingError: the obstacles do not fit.
    """
    wanted = [kind for kind in kinds for _ in range(kind.amount)]
    most = 0
    for _ in range(ATTEMPTS):
        placed = list(_placed(costmap, rng, course, wanted))
        if len(placed) == len(wanted) and _leaves_a_way(costmap, course, placed):
            return placed
        most = max(most, len(placed))
    raise PlacingError(_too_many(len(wanted), most, course))


def _placed(
    costmap: Costmap, rng: random.Random, course: Course, wanted: Sequence[ObstacleKind]
) -> Iterator[Placed]:
    """One attempt; it ends at the first obstacle that does not fit."""
    samples = _samples(course)
    discs = [(stop, costmap.radius) for stop in course.stops]
    for kind in wanted:
        for _ in range(_PLACES_PER_OBSTACLE):
            spot = _spot(costmap, rng, samples, kind)
            if costmap.clearance_at(spot) >= kind.radius and all(
                math.dist(spot, other) >= kind.radius + radius for other, radius in discs
            ):
                discs.append((spot, kind.radius))
                yield Placed(kind, Pose(*spot, rng.uniform(-math.pi, math.pi)))
                break
        else:
            return


def _spot(
    costmap: Costmap, rng: random.Random, samples: npt.NDArray[np.float64], kind: ObstacleKind
) -> Point:
    """A position within the allowed distance from the path, or anywhere on the map."""
    if kind.max_distance is None:
        x0, x1, y0, y1 = costmap.map.extent
        return rng.uniform(x0, x1), rng.uniform(y0, y1)
    x, y = samples[rng.randrange(len(samples))]
    # The square root distributes positions evenly over the disc around a point of the path.
    away, angle = kind.max_distance * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
    return float(x + away * math.cos(angle)), float(y + away * math.sin(angle))


def _samples(course: Course) -> npt.NDArray[np.float64]:
    """Points along the path, 10 cm apart, without the part to skip."""
    found: list[Point] = []
    gone = 0.0
    for a, b in itertools.pairwise(course.points):
        length = math.dist(a, b)
        for step in np.arange(0.0, length, 0.1):
            if gone + step >= course.skip:
                part = step / length
                found.append((a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])))
        gone += length
    if course.points and not found:
        raise PlacingError(
            f"the path is {gone:.2f} m long, and its first {course.skip:g} m must have no obstacle"
        )
    return np.array(found)


def _leaves_a_way(costmap: Costmap, course: Course, placed: Sequence[Placed]) -> bool:
    if len(course.stops) < 2:
        return True
    inflated = costmap.without([(one.pose.point, one.kind.radius) for one in placed])
    return all(
        inflated.shortest_path(a, b) is not None for a, b in itertools.pairwise(course.stops)
    )


def _too_many(wanted: int, most: int, course: Course) -> str:
    if most < wanted:
        found = f"only {most} of {wanted} obstacles fit"
    else:
        noun = "obstacle fits, but blocks" if wanted == 1 else "obstacles fit, but block"
        found = f"{wanted} {noun} the way to a goal,"
    near = " near the path" if course.points else ""
    return (
        f"{found}{near} in {ATTEMPTS} attempts; ask for fewer or smaller ones, or a larger "
        "`max_distance`"
    )
