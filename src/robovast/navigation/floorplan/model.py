"""The model of a floor plan: spaces, their features, and openings in their walls.

Lengths are in metres, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from robovast.base.errors import Place
from robovast.navigation.poses import Point

LONGEST_NAME = 100
"""Longest name of a plan [characters]; names of files contain it."""


@dataclass
class Rectangle:
    """A rectangle, centred at its frame."""

    width: float
    depth: float
    """Written as `length` on the floor, as `height` in a wall."""


@dataclass
class Circle:
    """A circle, centred at its frame."""

    radius: float


@dataclass
class Polygon:
    """A polygon, given by its corners in order."""

    points: list[Point]


Shape = Rectangle | Circle | Polygon


@dataclass(frozen=True)
class FrameRef:
    """The frame of a space, or of one of its walls."""

    space: str
    """Name of a space, `this`, or `world`."""
    wall: int | None = None

    def __str__(self) -> str:
        return self.space if self.wall is None else f"{self.space}.walls[{self.wall}]"


@dataclass
class Location:
    """A pose in a frame."""

    wrt: FrameRef
    """The frame that the pose is given in."""
    of: FrameRef = FrameRef("this")
    """The frame that has this pose."""
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    rotation: float = 0.0
    """Angle about z on the floor, about y in a wall."""
    spaced: bool = False
    """Leave room for the walls of both spaces."""
    aligned: bool = True
    """Rotate by 180°, so that two spaces are on opposite sides of two walls."""


@dataclass
class Feature:
    """Something on the floor."""

    kind: Literal["Column", "Divider"]
    name: str
    shape: Shape
    height: float
    location: Location
    place: Place


@dataclass
class Space:
    """A room, with walls around it."""

    name: str
    shape: Shape
    location: Location
    place: Place
    wall_thickness: float | None = None
    """None means the plan's default."""
    wall_height: float | None = None
    """None means the plan's default."""
    features: list[Feature] = field(default_factory=list)


@dataclass
class Opening:
    """A doorway or a window."""

    kind: Literal["Entryway", "Window"]
    name: str
    shape: Shape
    walls: list[FrameRef]
    """The wall whose frame its pose is in, and optionally the wall on the other side."""
    location: Location
    place: Place


@dataclass
class FloorPlan:
    """A whole model."""

    name: str
    place: Place
    spaces: list[Space] = field(default_factory=list)
    openings: list[Opening] = field(default_factory=list)
    features: list[Feature] = field(default_factory=list)
    """Features outside of spaces."""
    wall_thickness: float = 0.2
    wall_height: float = 2.5

    def thickness(self, space: Space) -> float:
        """Thickness of a space's walls [m]."""
        return self.wall_thickness if space.wall_thickness is None else space.wall_thickness

    def height(self, space: Space) -> float:
        """Height of a space's walls [m]."""
        return self.wall_height if space.wall_height is None else space.wall_height
