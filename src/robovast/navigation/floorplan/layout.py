"""Resolves the positions in a floor plan: frames, walls around rooms, openings in walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import shapely
from shapely import affinity
from shapely.geometry import Polygon as Area

from robovast.base.errors import DocumentError, Place, Problem
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
"""Highest lower edge of an entryway that a robot can drive through [m]."""

_SLACK = 0.001
"""How far an opening extends beyond a wall, to cut it completely [m]."""

_SIDES_OF_CIRCLE = 32
_MOST_CHAINED = 100
"""Most spaces of which each is placed at the next."""


@dataclass(frozen=True)
class Wall:
    """One wall of a room."""

    frame: Pose
    """In the middle of a side of the room's shape: x to the next corner, y to the left."""
    length: float
    """Length of that side [m]."""
    thickness: float
    """Along y: outside of shapes with clockwise corners, inside of any others [m]."""
    height: float


@dataclass(frozen=True)
class Room:
    """A space with its position."""

    space: Space
    frame: Pose
    floor: Area
    """The area that its walls enclose."""
    walls: tuple[Wall, ...]
    solid: Area
    """The area of its walls."""

    @property
    def height(self) -> float:
        """Height of its walls [m]."""
        return self.walls[0].height


@dataclass(frozen=True)
class PlacedFeature:
    """A column or divider with its position."""

    feature: Feature
    frame: Pose
    solid: Area


@dataclass(frozen=True)
class PlacedOpening:
    """An opening with its position."""

    opening: Opening
    frame: Pose
    """The first wall's frame, moved along the wall."""
    outline: Area
    """Shape in the wall: position along it, and height above the floor."""
    near: float
    """Start of the opening along the y axis of the first wall's frame [m]."""
    far: float
    """End of the opening [m]."""

    @property
    def is_way(self) -> bool:
        """Whether a robot can drive through it."""
        return self.opening.kind == "Entryway" and self.outline.bounds[1] <= FLOOR

    @property
    def footprint(self) -> Area:
        """Its area in the floor's plane."""
        left, _, right, _ = self.outline.bounds
        return _placed(shapely.box(left, self.near, right, self.far), self.frame)


@dataclass(frozen=True)
class PlacedFloorPlan:
    """A floor plan with all positions in the world frame."""

    plan: FloorPlan
    rooms: tuple[Room, ...]
    features: tuple[PlacedFeature, ...]
    openings: tuple[PlacedOpening, ...]


def lay_out(plan: FloorPlan) -> PlacedFloorPlan:
    """Resolve the positions of everything in a plan.

    Raises:
        DocumentError: a frame does not exist, or spaces refer to one another in a cycle.
    """
    rooms = _Rooms(plan)
    placed = [rooms.at(space.name, space.place) for space in plan.spaces]
    features = [
        _feature(feature, rooms, room) for room in placed for feature in room.space.features
    ]
    features += [_feature(feature, rooms, None) for feature in plan.features]
    openings = [_opening(opening, rooms) for opening in plan.openings]
    return PlacedFloorPlan(plan, tuple(placed), tuple(features), tuple(openings))


class _Rooms:
    """The rooms of a plan in any order; each is resolved on first use."""

    def __init__(self, plan: FloorPlan) -> None:
        self._plan = plan
        self._spaces = {space.name: space for space in plan.spaces}
        self._placed: dict[str, Room] = {}
        self._asked: list[str] = []

    def at(self, name: str, place: Place) -> Room:
        """The room of a space.

        Args:
            name: name of the space.
            place: position of the reference, for errors.

        Raises:
            DocumentError: the space does not exist or refers to itself.
        """
        if name in self._placed:
            return self._placed[name]
        if name not in self._spaces:
            known = ", ".join(self._spaces) or "none"
            raise _problem(place, f"there is no space `{name}`", f"There are: {known}.")
        if name in self._asked:
            circle = " → ".join([*self._asked[self._asked.index(name) :], name])
            raise _problem(place, f"spaces are placed at one another in a circle: {circle}")
        if len(self._asked) > _MOST_CHAINED:
            raise _problem(
                place,
                f"more than {_MOST_CHAINED} spaces are placed one at another in a row",
                "Place some of them at `world`.",
            )
        self._asked.append(name)
        room = self._placed[name] = _room(self._plan, self._spaces[name], self)
        self._asked.pop()
        return room

    def wall(self, ref: FrameRef, place: Place) -> Wall:
        """A wall of a space.

        Raises:
            DocumentError: there is no such space or wall.
        """
        walls = self.at(ref.space, place).walls
        if ref.wall is None or not 0 <= ref.wall < len(walls):
            raise _no_wall(ref, len(walls), place)
        return walls[ref.wall]

    def frame(self, ref: FrameRef, place: Place) -> Pose:
        """The frame of the world, of a space or of a wall.

        Raises:
            DocumentError: there is no such space or wall.
        """
        if ref.space == "world":
            return Pose(0.0, 0.0)
        return self.at(ref.space, place).frame if ref.wall is None else self.wall(ref, place).frame


def compose(a: Pose, b: Pose) -> Pose:
    """Convert the pose `b` from the frame `a` to the frame in which `a` is given."""
    cos, sin = math.cos(a.yaw), math.sin(a.yaw)
    return Pose(a.x + cos * b.x - sin * b.y, a.y + sin * b.x + cos * b.y, a.yaw + b.yaw)


def inverse(pose: Pose) -> Pose:
    """The pose of the outer frame in the frame that a pose describes."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Pose(-cos * pose.x - sin * pose.y, sin * pose.x - cos * pose.y, -pose.yaw)


def _room(plan: FloorPlan, space: Space, rooms: _Rooms) -> Room:
    outline = _outline(space.shape)
    if not outline.is_valid:
        raise _problem(space.place, f"the sides of `{space.name}` cross one another")
    thickness, height = plan.thickness(space), plan.height(space)
    walls = _walls(outline, thickness, height)
    frame = _frame(space, walls, rooms, thickness)
    if outline.exterior.is_ccw:
        solid = outline.difference(outline.buffer(-thickness, join_style="mitre"))
    else:
        solid = outline.buffer(thickness, join_style="mitre").difference(outline)
    placed = tuple(
        Wall(compose(frame, wall.frame), wall.length, thickness, height) for wall in walls
    )
    return Room(space, frame, _placed(outline, frame), placed, _placed(solid, frame))


def _frame(space: Space, walls: list[Wall], rooms: _Rooms, thickness: float) -> Pose:
    """The position of a space in the world."""
    location = space.location
    offset = _offset(location)
    base = rooms.frame(location.wrt, space.place)
    if location.of.wall is None:
        return compose(base, offset)
    if not 0 <= location.of.wall < len(walls):
        raise _no_wall(location.of, len(walls), space.place)
    if location.wrt.wall is not None:
        wall = rooms.wall(location.wrt, space.place)
        apart = wall.thickness + thickness if location.spaced else 0.0
        turn = math.pi if location.aligned else 0.0
        offset = Pose(offset.x, offset.y + apart, offset.yaw + turn)
    return compose(compose(base, offset), inverse(walls[location.of.wall].frame))


def _walls(outline: Area, thickness: float, height: float) -> list[Wall]:
    """The walls of an outline, in the order of its corners."""
    found = []
    for (x0, y0), (x1, y1) in pairwise(outline.exterior.coords):
        yaw = math.atan2(y1 - y0, x1 - x0)
        frame = Pose((x0 + x1) / 2, (y0 + y1) / 2, yaw)
        found.append(Wall(frame, math.dist((x0, y0), (x1, y1)), thickness, height))
    return found


def _feature(feature: Feature, rooms: _Rooms, own: Room | None) -> PlacedFeature:
    ref = feature.location.wrt
    if ref.space == "this" and own is not None:
        ref = FrameRef(own.space.name, ref.wall)
    frame = compose(rooms.frame(ref, feature.place), _offset(feature.location))
    return PlacedFeature(feature, frame, _placed(_outline(feature.shape), frame))


def _opening(opening: Opening, rooms: _Rooms) -> PlacedOpening:
    first, *others = (rooms.wall(ref, opening.place) for ref in opening.walls)
    far = first.thickness + sum(other.thickness for other in others)
    outline = affinity.rotate(_outline(opening.shape), opening.location.rotation, use_radians=True)
    outline = affinity.translate(outline, opening.location.x, opening.location.z)
    return PlacedOpening(opening, first.frame, outline, -_SLACK, far + _SLACK)


def _no_wall(ref: FrameRef, count: int, place: Place) -> DocumentError:
    return _problem(place, f"there is no `{ref}`: the space has walls[0] to walls[{count - 1}]")


def _problem(place: Place, message: str, remedy: str = "") -> DocumentError:
    return DocumentError([Problem(place, "", message, remedy)])


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
