"""Where everything of a floor plan is: frames resolved, walls around rooms, openings in walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations, pairwise

import shapely
from shapely import affinity
from shapely.geometry import Polygon as Area

from robovast.errors import DocumentError, Place, Problem
from robovast.navigation.floorplan.model import (
    Circle,
    Feature,
    FloorPlan,
    FrameRef,
    Location,
    Opening,
    Polygon,
    Rectangle,
    Shape,
    Space,
)
from robovast.navigation.poses import Point, Pose

FLOOR = 0.05
"""An entryway that begins above this height is no way for a robot [m]."""

_SLACK = 0.001
"""How far an opening reaches beyond a wall, so that no film is left [m]."""

_LEAST_OVERLAP = 1e-4
"""Smaller overlaps of rooms are errors of rounding [m²]."""

_SIDES_OF_CIRCLE = 32


@dataclass(frozen=True)
class Wall:
    """One wall of a room."""

    frame: Pose
    """In the middle of its inner edge; x along it, y outwards."""
    length: float
    """Of its inner edge [m]."""
    thickness: float
    height: float


@dataclass(frozen=True)
class Room:
    """A space at its place."""

    space: Space
    frame: Pose
    floor: Area
    """What its walls enclose."""
    walls: tuple[Wall, ...]
    solid: Area
    """What its walls stand on."""

    @property
    def height(self) -> float:
        """Of its walls [m]."""
        return self.walls[0].height


@dataclass(frozen=True)
class PlacedFeature:
    """A column or divider at its place."""

    feature: Feature
    frame: Pose
    solid: Area


@dataclass(frozen=True)
class PlacedOpening:
    """An opening at its place."""

    opening: Opening
    frame: Pose
    """Of the first wall, moved along it."""
    outline: Area
    """In the wall: along it, and height above the floor."""
    near: float
    """Where it begins, from the inner edge of the first wall outwards [m]."""
    far: float
    """Where it ends [m]."""

    @property
    def is_way(self) -> bool:
        """True when a robot can drive through it."""
        return self.opening.kind == "Entryway" and self.outline.bounds[1] <= FLOOR

    @property
    def footprint(self) -> Area:
        """What it takes of the floor's plane."""
        left, _, right, _ = self.outline.bounds
        return _placed(shapely.box(left, self.near, right, self.far), self.frame)


@dataclass(frozen=True)
class Layout:
    """A floor plan with everything at its place in the world."""

    plan: FloorPlan
    rooms: tuple[Room, ...]
    features: tuple[PlacedFeature, ...]
    openings: tuple[PlacedOpening, ...]


def lay_out(plan: FloorPlan) -> Layout:
    """Where everything of a plan is.

    Raises:
        DocumentError: rooms overlap, an opening is wider than its wall, a frame does not exist.
    """
    rooms: dict[str, Room] = {}
    for space in plan.spaces:
        rooms[space.name] = _room(plan, space, rooms)
    problems = list(_overlaps(list(rooms.values())))
    openings = []
    for opening in plan.openings:
        placed = _opening(opening, rooms)
        wall = _wall(rooms, opening.walls[0], opening.place)
        left, _, right, _ = placed.outline.bounds
        if max(-left, right) > wall.length / 2 + _SLACK:
            problems.append(
                Problem(
                    opening.place,
                    "",
                    f"`{opening.name}` reaches {max(-left, right) - wall.length / 2:.2f} m beyond "
                    f"the end of `{opening.walls[0]}`, which is {wall.length:g} m long",
                )
            )
        openings.append(placed)
    if problems:
        raise DocumentError(problems)
    features = [
        _feature(feature, room) for room in rooms.values() for feature in room.space.features
    ]
    return Layout(plan, tuple(rooms.values()), tuple(features), tuple(openings))


def compose(a: Pose, b: Pose) -> Pose:
    """The pose `b`, given in the frame `a`, in the frame that `a` is given in."""
    cos, sin = math.cos(a.yaw), math.sin(a.yaw)
    return Pose(a.x + cos * b.x - sin * b.y, a.y + sin * b.x + cos * b.y, a.yaw + b.yaw)


def inverse(pose: Pose) -> Pose:
    """The pose of the outer frame in the frame that a pose describes."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Pose(-cos * pose.x - sin * pose.y, sin * pose.x - cos * pose.y, -pose.yaw)


def _room(plan: FloorPlan, space: Space, rooms: dict[str, Room]) -> Room:
    outline = _outline(space.shape)
    if not outline.is_valid:
        raise DocumentError(
            [Problem(space.place, "", f"the sides of `{space.name}` cross one another")]
        )
    thickness, height = plan.thickness(space), plan.height(space)
    walls = _walls(outline, thickness, height)
    frame = _frame(space, walls, rooms, thickness)
    solid = outline.buffer(thickness, join_style="mitre").difference(outline)
    placed = tuple(
        Wall(compose(frame, wall.frame), wall.length, thickness, height) for wall in walls
    )
    return Room(space, frame, _placed(outline, frame), placed, _placed(solid, frame))


def _frame(space: Space, walls: list[Wall], rooms: dict[str, Room], thickness: float) -> Pose:
    """Where a space is in the world."""
    location = space.location
    offset = _offset(location)
    if location.wrt.space == "world":
        base = Pose(0.0, 0.0)
    elif location.wrt.wall is None:
        base = _known(rooms, location.wrt, space.place).frame
    else:
        wall = _wall(rooms, location.wrt, space.place)
        base = wall.frame
        if location.spaced:
            offset = Pose(offset.x, offset.y + wall.thickness + thickness, offset.yaw)
    if location.of.wall is None:
        return compose(base, offset)
    if location.of.wall >= len(walls):
        raise _no_wall(location.of, len(walls), space.place)
    if location.wrt.wall is not None and location.aligned:
        offset = Pose(offset.x, offset.y, offset.yaw + math.pi)
    return compose(compose(base, offset), inverse(walls[location.of.wall].frame))


def _walls(outline: Area, thickness: float, height: float) -> list[Wall]:
    """The walls of an outline, in the order of its corners."""
    corners = list(outline.exterior.coords)
    turned = math.pi if outline.exterior.is_ccw else 0.0
    found = []
    for (x0, y0), (x1, y1) in pairwise(corners):
        yaw = math.atan2(y1 - y0, x1 - x0) + turned
        frame = Pose((x0 + x1) / 2, (y0 + y1) / 2, yaw)
        found.append(Wall(frame, math.dist((x0, y0), (x1, y1)), thickness, height))
    return found


def _feature(feature: Feature, room: Room) -> PlacedFeature:
    wall = feature.location.wrt.wall
    if wall is not None and wall >= len(room.walls):
        raise _no_wall(feature.location.wrt, len(room.walls), feature.place)
    base = room.frame if wall is None else room.walls[wall].frame
    frame = compose(base, _offset(feature.location))
    return PlacedFeature(feature, frame, _placed(_outline(feature.shape), frame))


def _opening(opening: Opening, rooms: dict[str, Room]) -> PlacedOpening:
    first, *others = (_wall(rooms, ref, opening.place) for ref in opening.walls)
    near, far = 0.0, first.thickness
    for other in others:
        inner = compose(inverse(first.frame), other.frame).y
        near, far = min(near, inner - other.thickness), max(far, inner)
    outline = affinity.rotate(_outline(opening.shape), opening.location.rotation, use_radians=True)
    bottom = max(opening.location.z + outline.bounds[1], 0.0)
    outline = affinity.translate(outline, 0.0, bottom - outline.bounds[1])
    outline = affinity.translate(outline, opening.location.x)
    return PlacedOpening(opening, first.frame, outline, near - _SLACK, far + _SLACK)


def _overlaps(rooms: list[Room]) -> list[Problem]:
    found = []
    for a, b in combinations(rooms, 2):
        area = a.floor.intersection(b.floor).area
        wanted = not (a.space.location.aligned and b.space.location.aligned)
        if area > _LEAST_OVERLAP and not wanted:
            found.append(
                Problem(
                    b.space.place,
                    "",
                    f"the space `{b.space.name}` overlaps `{a.space.name}` by {area:.2f} m²",
                    "Move one of them, or add `spaced`; `not aligned` says that it is meant.",
                )
            )
    return found


def _known(rooms: dict[str, Room], ref: FrameRef, place: Place) -> Room:
    if ref.space in rooms:
        return rooms[ref.space]
    known = ", ".join(rooms) or "none"
    raise DocumentError(
        [
            Problem(
                place,
                "",
                f"there is no space `{ref.space}` before this",
                f"A space is placed in the world or at one that comes before it: {known}.",
            )
        ]
    )


def _wall(rooms: dict[str, Room], ref: FrameRef, place: Place) -> Wall:
    walls = _known(rooms, ref, place).walls
    if ref.wall is None or ref.wall >= len(walls):
        raise _no_wall(ref, len(walls), place)
    return walls[ref.wall]


def _no_wall(ref: FrameRef, count: int, place: Place) -> DocumentError:
    message = f"there is no `{ref}`: the space has walls[0] to walls[{count - 1}]"
    return DocumentError([Problem(place, "", message)])


def _offset(location: Location) -> Pose:
    return Pose(location.x, location.y, location.rotation)


def _outline(shape: Shape) -> Area:
    """A shape in its own frame; a rectangle's sides are top, right, bottom and left."""
    match shape:
        case Rectangle():
            x, y = shape.width / 2, shape.depth / 2
            return Area([(-x, y), (x, y), (x, -y), (-x, -y)])
        case Polygon():
            return Area(shape.points)
        case Circle():
            return Area([_on_circle(shape.radius, n) for n in range(_SIDES_OF_CIRCLE)])


def _on_circle(radius: float, number: int) -> Point:
    angle = -2 * math.pi * number / _SIDES_OF_CIRCLE
    return radius * math.cos(angle), radius * math.sin(angle)


def _placed(area: Area, frame: Pose) -> Area:
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return affinity.affine_transform(area, [cos, -sin, sin, cos, frame.x, frame.y])
