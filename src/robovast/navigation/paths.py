"""Draws a start and goals such that the path through them has a given length."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from robovast.navigation.costmap import LATTICE_EXCESS, Costmap, Lattice
from robovast.navigation.poses import Point, Pose, heading, length_of

ATTEMPTS = 200
"""Most attempts to draw a path."""

_GOALS_PER_ATTEMPT = 8
"""Most candidates for the last goal that are tried from one place."""


class NoPathError(ValueError):
    """No path meets the requirements."""


@dataclass(frozen=True)
class Path:
    """A shortest path from a start through goals, in order."""

    start: Pose
    goals: tuple[Pose, ...]
    points: tuple[Point, ...]
    """Corners from the start to the last goal."""
    length: float
    """[m]"""


@dataclass(frozen=True)
class Wish:
    """Requirements for a path; None means that a value is drawn."""

    length: float
    """[m]"""
    tolerance: float
    """[m]"""
    min_distance: float = 0.0
    """Least straight-line distance between any two poses [m]."""
    goals: int = 1
    """Number of goals."""
    start: Pose | None = None
    fixed_goals: tuple[Pose, ...] | None = None


@dataclass(frozen=True)
class Draft:
    """An unfinished path."""

    stops: list[Point]
    """Start and goals so far."""
    points: list[Point] = field(default_factory=list)
    """Corners so far, including stops."""
    length: float = 0.0
    """[m]"""

    def extended(self, way: Sequence[Point]) -> Draft:
        """The draft extended by a path from its last stop."""
        points = [*self.points, *(way[1:] if self.points else way)]
        return Draft([*self.stops, way[-1]], points, self.length + length_of(list(way)))


def draw_path(costmap: Costmap, rng: random.Random, wish: Wish) -> Path:
    """Draw a path that meets the requirements; equal generators give equal paths.

    Raises:
        NoPathError: none was found; the message says why.
    """
    require_passable(costmap, wish)
    if wish.fixed_goals is not None:
        return _through(costmap, rng, wish, wish.fixed_goals)
    lattice = costmap.lattice
    if not lattice.points:
        raise NoPathError(
            f"the map has no room for a robot of {2 * costmap.radius:g} m: no free cell is "
            f"{costmap.radius:g} m from every obstacle"
        )
    for _ in range(ATTEMPTS):
        draft = _drawn(costmap, lattice, rng, wish)
        if draft is not None:
            return finished(draft, wish.start)
    raise NoPathError(
        f"{_describe_wish(wish)} was found in {ATTEMPTS} attempts. {_reach(costmap, wish)}"
    )


def require_passable(costmap: Costmap, wish: Wish) -> None:
    """Check that the robot can be at every given pose.

    Raises:
        NoPathError: a pose is not passable.
    """
    given = [("start", wish.start)] if wish.start else []
    given += [("goal", goal) for goal in wish.fixed_goals or ()]
    for what, pose in given:
        if not costmap.is_passable(pose.point):
            place = f"the {what} ({pose.x:g}, {pose.y:g})"
            clearance = costmap.clearance_at(pose.point)
            if clearance <= 0:
                raise NoPathError(
                    f"{place} is inside a wall, in unknown space or outside the map "
                    f"({_extent(costmap)})"
                )
            raise NoPathError(
                f"{place} is {clearance:.2f} m from the nearest obstacle; a robot of "
                f"{2 * costmap.radius:g} m needs {costmap.radius:g} m"
            )


def measured_path(costmap: Costmap, start: Pose, goals: Sequence[Pose]) -> Path:
    """The shortest path through given poses.

    Raises:
        NoPathError: there is no path.
    """
    draft = Draft([start.point])
    for goal in goals:
        here = draft.stops[-1]
        way = costmap.shortest_path(here, goal.point)
        if way is None:
            raise NoPathError(
                f"there is no way from ({here[0]:g}, {here[1]:g}) to ({goal.x:g}, {goal.y:g}) for "
                f"a robot of {2 * costmap.radius:g} m"
            )
        draft = draft.extended(way)
    return Path(start, tuple(goals), tuple(draft.points), draft.length)


def _through(costmap: Costmap, rng: random.Random, wish: Wish, goals: tuple[Pose, ...]) -> Path:
    """A path to given goals, from a given or drawn start."""
    if wish.start is not None:
        path = measured_path(costmap, wish.start, goals)
        if abs(path.length - wish.length) > wish.tolerance:
            raise NoPathError(
                f"the way through the given poses is {path.length:.2f} m long, not "
                f"{wish.length:g} m (± {wish.tolerance:g} m)"
            )
        return path
    rest = measured_path(costmap, goals[0], goals[1:])
    lattice = costmap.lattice
    first = lattice.node_near(goals[0].point)
    others = [goal.point for goal in goals]
    target = wish.length - rest.length
    for node in [] if first is None else _ring(lattice, rng, first, target, wish, others):
        start = lattice.points[node]
        way = costmap.shortest_path(start, goals[0].point)
        if way is not None and abs(length_of(way) - target) <= wish.tolerance:
            draft = Draft([start, *others], [*way, *rest.points[1:]], length_of(way) + rest.length)
            return finished(draft, goals=goals)
    raise NoPathError(
        f"no start is {target:.2f} m (± {wish.tolerance:g} m) from the first given goal, which "
        f"the length of {wish.length:g} m needs"
    )


def _drawn(costmap: Costmap, lattice: Lattice, rng: random.Random, wish: Wish) -> Draft | None:
    """One attempt to draw a path."""
    start = wish.start.point if wish.start else lattice.points[rng.randrange(len(lattice.points))]
    draft = Draft([start])
    shares = [rng.uniform(0.5, 1.5) for _ in range(wish.goals)]
    for index in range(wish.goals - 1):
        target = (wish.length - draft.length) * shares[index] / sum(shares[index:])
        leg = next(_legs(costmap, lattice, rng, draft, wish, target, target / 4), None)
        if leg is None:
            return None
        draft = leg
    target = wish.length - draft.length
    legs = _legs(costmap, lattice, rng, draft, wish, target, wish.tolerance)
    good = (leg for leg in legs if abs(leg.length - wish.length) <= wish.tolerance)
    return next(good, None)


def _legs(
    costmap: Costmap,
    lattice: Lattice,
    rng: random.Random,
    draft: Draft,
    wish: Wish,
    target: float,
    tolerance: float,
) -> Iterator[Draft]:
    """Drafts with an additional goal, about `target` metres further."""
    here = draft.stops[-1]
    first = lattice.node_near(here)
    if first is None:
        return
    limits = Wish(target, tolerance, wish.min_distance)
    for node in _ring(lattice, rng, first, target, limits, draft.stops):
        ways = lattice.ways_from(first, (target + tolerance) * LATTICE_EXCESS)
        yield draft.extended(costmap.straightened([here, *ways.points_to(node)]))


def _ring(
    lattice: Lattice,
    rng: random.Random,
    first: int,
    target: float,
    wish: Wish,
    others: Sequence[Point],
) -> list[int]:
    """Some random nodes about `target` metres from a node and not near any of the others."""
    reach = (target + wish.tolerance) * LATTICE_EXCESS
    lengths = lattice.ways_from(first, reach).lengths
    found = np.flatnonzero((lengths >= target - wish.tolerance) & (lengths <= reach))
    for other in others:
        apart = np.hypot(*(lattice.places[found] - other).T)
        found = found[apart >= max(wish.min_distance, 1e-9)]
    nodes = [int(node) for node in found]
    return rng.sample(nodes, min(len(nodes), _GOALS_PER_ATTEMPT))


def finished(
    draft: Draft, start: Pose | None = None, goals: tuple[Pose, ...] | None = None
) -> Path:
    """The complete path; poses that are not given look along it."""
    points = draft.points
    return Path(
        start or Pose(*points[0], heading(points[0], points[1])),
        goals or tuple(_arrivals(draft)),
        tuple(points),
        draft.length,
    )


def _arrivals(draft: Draft) -> Iterator[Pose]:
    index = 0
    for stop in draft.stops[1:]:
        index = draft.points.index(stop, index + 1)
        yield Pose(*stop, heading(draft.points[index - 1], stop))


def _describe_wish(wish: Wish) -> str:
    goals = "1 goal" if wish.goals == 1 else f"{wish.goals} goals"
    apart = f", {wish.min_distance:g} m apart," if wish.min_distance else ""
    return f"no path of {wish.length:g} m (± {wish.tolerance:g} m) with {goals}{apart}"


def _reach(costmap: Costmap, wish: Wish) -> str:
    lattice = costmap.lattice
    parts = np.bincount(lattice.components)
    node = (
        lattice.node_near(wish.start.point)
        if wish.start
        else int(np.flatnonzero(lattice.components == parts.argmax())[0])
    )
    if node is None:
        return "The start has no free space around it."
    lengths = lattice.ways_from(node).lengths
    longest = float(lengths[np.isfinite(lengths)].max())
    place = "the start" if wish.start else "one end of the largest free part"
    hint = "Allow a shorter path, a larger tolerance or poses that are nearer to one another."
    return f"The farthest place is about {longest:.1f} m from {place}. {hint}"


def _extent(costmap: Costmap) -> str:
    x0, x1, y0, y1 = costmap.map.extent
    return f"x from {x0:g} to {x1:g} m, y from {y0:g} to {y1:g} m"
