"""Reads models of floor plans (.fpm)."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from robovast.navigation.floorplan.model import (
    LONGEST_NAME,
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
from robovast.navigation.floorplan.parser import ANGLES, UNITS, ParsedFile, kind

_FALLBACK = Rectangle(1.0, 1.0)


def read_floorplan(path: Path) -> FloorPlan:
    """Read a model.

    Raises:
        InputError: the file cannot be read.
        DocumentError: all its errors, with line and column.
    """
    return Model(path).plan()


class Model:
    """A parsed model in which numbers can be replaced.

    Args:
        path: the file.

    Raises:
        InputError: the file cannot be read.
        DocumentError: a syntax error, with line and column.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._source = ParsedFile(path, "floorplan.tx")

    @property
    def root(self) -> Any:
        """The syntax tree."""
        return self._source.model

    def plan(self) -> FloorPlan:
        """The floor plan with the current numbers.

        Raises:
            DocumentError: all its errors, with line and column.
        """
        self._source.problems.clear()
        plan = _Reader(self._source).plan()
        self._source.finish()
        return plan


class _Reader:
    """Converts a syntax tree to a model; collects errors and continues."""

    def __init__(self, source: ParsedFile) -> None:
        self._source = source
        self._items = _by_kind(source.model.items)
        self._variables = {variable.name: variable for variable in self._items["Variable"]}

    def plan(self) -> FloorPlan:
        model = self._source.model
        plan = FloorPlan(model.name, self._source.place(model))
        if len(plan.name) > LONGEST_NAME:
            self._source.problem(
                model,
                f"the name {plan.name[:20]}… has {len(plan.name)} characters; names of floor plans "
                f"have at most {LONGEST_NAME}",
            )
        for defaults in self._items["Defaults"]:
            sizes = self._wall_sizes(defaults.parts)
            plan.wall_thickness = sizes.get("thickness", plan.wall_thickness)
            plan.wall_height = sizes.get("height", plan.wall_height)
        plan.spaces = [self._space(node) for node in self._items["Space"]]
        plan.openings = [self._opening(node) for node in self._items["Opening"]]
        plan.features = [self._feature(node, "world") for node in self._items["Feature"]]
        self._check_names(self._items["Variable"], "among the variables")
        named = ("Space", "Opening", "Feature")
        self._check_names((i for i in model.items if kind(i) in named), "in this floor plan")
        if not plan.spaces:
            self._source.problem(model, f"the floor plan `{plan.name}` has no `Space`")
        return plan

    def _space(self, node: Any) -> Space:
        parts = _by_kind(node.parts)
        sizes = self._wall_sizes(parts["Walls"])
        location = self._location(node, parts["Location"], default=FrameRef("world"))
        self._set_flags(location, parts["Flag"])
        features = [f for part in parts["Features"] for f in part.features]
        self._check_names(features, f"in the space `{node.name}`")
        return Space(
            node.name,
            self._shape(node, parts["ShapeOf"], ("width", "length")),
            location,
            self._source.place(node),
            sizes.get("thickness"),
            sizes.get("height"),
            [self._feature(feature, "this") for feature in features],
        )

    def _feature(self, node: Any, frame: str) -> Feature:
        parts = _by_kind(node.parts)
        location = self._location(node, parts["Location"], default=FrameRef(frame))
        heights = [self._size(part.value, "the height") for part in parts["Height"]]
        if not heights:
            self._source.problem(node, f"`{node.name}` has no `height`")
        return Feature(
            node.kind,
            node.name,
            self._shape(node, parts["ShapeOf"], ("width", "length")),
            heights[0] if heights else 1.0,
            location,
            self._source.place(node),
        )

    def _opening(self, node: Any) -> Opening:
        parts = _by_kind(node.parts)
        located = [part for location in parts["Location"] for part in location.parts]
        walls = [_frame(wall) for part in _by_kind(located)["In"] for wall in part.walls]
        location = self._location(node, parts["Location"], default=FrameRef("this"))
        if not 1 <= len(walls) <= 2 or any(wall.wall is None for wall in walls):
            self._source.problem(
                node,
                f"`{node.name}` must be in one wall, or in two",
                "Write `in: room.walls[0]` or `in: room.walls[0] and hall.walls[2]`.",
            )
        return Opening(
            node.kind,
            node.name,
            self._shape(node, parts["ShapeOf"], ("width", "height"), upright=True),
            walls,
            location,
            self._source.place(node),
        )

    def _location(self, node: Any, found: list[Any], default: FrameRef) -> Location:
        location = Location(default)
        for part in (part for one in found for part in one.parts):
            match kind(part):
                case "FrameOf" if part.key in ("wrt", "from"):
                    location.wrt = _frame(part.frame)
                case "FrameOf":
                    location.of = _frame(part.frame)
                case "Translation":
                    for axis in part.axes:
                        setattr(location, axis.key, self._number(axis.value, angle=False))
                case "Rotation":
                    location.rotation = self._number(part.axes[-1].value, angle=True)
                case "Flag":
                    self._set_flags(location, [part])
        if not found and kind(node) != "Feature":
            self._source.problem(node, f"`{node.name}` has no `location`")
        return location

    def _set_flags(self, location: Location, flags: list[Any]) -> None:
        location.spaced |= any(flag.spaced for flag in flags)
        location.aligned &= not any(flag.not_aligned for flag in flags)

    def _wall_sizes(self, found: list[Any]) -> dict[str, float]:
        sizes = (size for walls in found for size in walls.sizes)
        return {size.key: self._size(size.value, f"the {size.key} of a wall") for size in sizes}

    def _shape(
        self, node: Any, found: list[Any], sides: tuple[str, str], *, upright: bool = False
    ) -> Shape:
        if len(found) != 1:
            self._source.problem(node, f"`{node.name}` must have one `shape`, not {len(found)}")
            return _FALLBACK
        shape = found[0].shape
        match kind(shape):
            case "CircleShape":
                return Circle(self._size(shape.value, "the radius"))
            case "PolygonShape":
                return self._polygon(shape, upright=upright)
        values = {side.key: self._size(side.value, f"the {side.key}") for side in shape.sides}
        if set(values) != set(sides):
            self._source.problem(
                shape,
                f"this rectangle must have `{sides[0]}` and `{sides[1]}`, "
                f"not {' and '.join(f'`{key}`' for key in values)}",
            )
            return _FALLBACK
        return Rectangle(*(values[side] for side in sides))

    def _polygon(self, shape: Any, *, upright: bool) -> Polygon:
        """Corners by x and y; for upright shapes with three numbers per corner, by x and z."""
        points = [
            (
                self._number(point.x, angle=False),
                self._number(point.z if upright and point.z else point.y, angle=False),
            )
            for point in shape.points
        ]
        if len(set(points)) < 3:
            self._source.problem(shape, "a polygon needs three different points or more")
        return Polygon(points)

    def _size(self, value: Any, what: str) -> float:
        number = self._number(value, angle=False)
        if number <= 0:
            self._source.problem(value, f"{what} must be above 0 m, not {number:g} m")
        return number

    def _number(self, value: Any, *, angle: bool) -> float:
        """A value in metres or radians."""
        written = value
        if value.variable:
            written = self._variables.get(value.variable)
            if written is None:
                known = ", ".join(self._variables) or "none"
                self._source.problem(
                    value, f"there is no variable `{value.variable}`", f"There are: {known}."
                )
                return math.nan  # suppresses further errors
        if written.unit and (written.unit in ANGLES) != angle:
            wanted = "an angle in deg or rad" if angle else "a length in m, cm or mm"
            self._source.problem(value, f"{wanted} is needed here, not a value in {written.unit}")
        sign = -1.0 if value.negative else 1.0
        return sign * float(written.number) * UNITS[written.unit or "m"]

    def _check_names(self, nodes: Iterable[Any], where: str) -> None:
        named = list(nodes)
        counts = Counter(node.name for node in named)
        for node in named[::-1]:
            if counts[node.name] > 1:
                counts[node.name] -= 1
                self._source.problem(node, f"the name `{node.name}` is used twice {where}")


def _by_kind(nodes: Iterable[Any]) -> defaultdict[str, list[Any]]:
    """Nodes by grammar rule; empty for rules without nodes."""
    found: defaultdict[str, list[Any]] = defaultdict(list)
    for node in nodes:
        found[kind(node)].append(node)
    return found


def _frame(node: Any) -> FrameRef:
    return FrameRef(node.space, node.wall.index if node.wall else None)
