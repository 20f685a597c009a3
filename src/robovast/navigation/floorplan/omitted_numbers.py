"""Adds omitted numbers of a floor plan to its syntax tree, so that they can vary as well.

The classes have the names of the grammar's rules, because the reader dispatches on them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeVar

from robovast.navigation.floorplan.parser import kind


@dataclass
class Value:
    """A number, in metres or radians."""

    _tx_position: int
    number: float = 0.0
    unit: str = ""
    variable: str = ""
    negative: bool = False


@dataclass
class Axis:
    """One coordinate, or the size of a wall."""

    key: str
    value: Value


@dataclass
class Translation:
    """Where something is in its frame."""

    axes: list[Any] = field(default_factory=list)


@dataclass
class Rotation:
    """How it is turned there."""

    axes: list[Any] = field(default_factory=list)


@dataclass
class Location:
    """The pose of something."""

    parts: list[Any] = field(default_factory=list)


@dataclass
class Walls:
    """The sizes of a space's walls."""

    sizes: list[Any] = field(default_factory=list)


PartT = TypeVar("PartT", Location, Translation, Rotation, Walls)


def add_number(element: Any, attribute: str) -> Value | None:
    """Add a number that an element may have but lacks; None if it cannot have one.

    Args:
        element: a parsed space, opening or feature; it is changed.
        attribute: name such as `location.translation.x` or `wall.height`.
    """
    value = Value(element._tx_position)
    match attribute.split("."):
        case ["location", "translation", "x" | "y" | "z" as axis]:
            location = _part(element.parts, Location)
            _part(location.parts, Translation).axes.append(Axis(axis, value))
        case ["location", "rotation", "x" | "y" | "z" as axis]:
            location = _part(element.parts, Location)
            _part(location.parts, Rotation).axes.append(Axis(axis, value))
        case ["wall", "thickness" | "height" as size] if kind(element) == "Space":
            _part(element.parts, Walls).sizes.append(Axis(size, value))
        case _:
            return None
    return value


def _part(parts: list[Any], rule: type[PartT]) -> PartT:
    """The part made by a grammar rule; added if it is missing."""
    for part in parts:
        if kind(part) == rule.__name__:
            found: PartT = part
            return found
    made = rule()
    parts.append(made)
    return made
