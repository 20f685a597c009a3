"""Writes a floor plan in its language."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.navigation.floorplan.model import (
    Circle,
    Feature,
    FloorPlan,
    Location,
    Opening,
    Polygon,
    Shape,
    Space,
)


def write_floorplan(plan: FloorPlan) -> str:
    """The text of a model, with variables replaced by their values."""
    return "\n".join([f"Floor plan: {plan.name}", "", *_indented(_items(plan))]) + "\n"


def _items(plan: FloorPlan) -> Iterator[str]:
    yield "Defaults:"
    yield from _indented(_walls(plan.wall_thickness, plan.wall_height))
    for space in plan.spaces:
        yield ""
        yield from _space(space)
    for feature in plan.features:
        yield ""
        yield from _feature(feature)
    for opening in plan.openings:
        yield ""
        yield from _opening(opening)


def _space(space: Space) -> Iterator[str]:
    yield f"Space {space.name}:"
    yield f"    shape: {_shape(space.shape, 'length')}"
    yield from _indented(_location(space.location, "xy", frames=True))
    yield from _indented(_walls(space.wall_thickness, space.wall_height))
    if space.features:
        yield "    features:"
        for feature in space.features:
            yield from _indented(_indented(_feature(feature)))


def _feature(feature: Feature) -> Iterator[str]:
    yield f"{feature.kind} {feature.name}:"
    yield f"    shape: {_shape(feature.shape, 'length')}"
    yield f"    height: {feature.height:.6g} m"
    yield from _indented(_location(feature.location, "xy", frames=False))


def _opening(opening: Opening) -> Iterator[str]:
    yield f"{opening.kind} {opening.name}:"
    yield f"    shape: {_shape(opening.shape, 'height')}"
    yield "    location:"
    yield f"        in: {' and '.join(map(str, opening.walls))}"
    yield from _indented(_indented(_pose(opening.location, "xyz", "y")))


def _location(location: Location, axes: str, *, frames: bool) -> Iterator[str]:
    yield "location:"
    yield f"    wrt: {location.wrt}"
    if frames:
        yield f"    of: {location.of}"
    yield from _indented(_pose(location, axes, "z"))
    if location.spaced:
        yield "    spaced"
    if not location.aligned:
        yield "    not aligned"


def _pose(location: Location, axes: str, about: str) -> Iterator[str]:
    values = ", ".join(f"{axis}: {getattr(location, axis):.6g} m" for axis in axes)
    yield f"translation: {values}"
    yield f"rotation: {about}: {location.rotation:.6g} rad"


def _walls(thickness: float | None, height: float | None) -> Iterator[str]:
    sizes = {"thickness": thickness, "height": height}
    written = [f"    {key}: {value:.6g} m" for key, value in sizes.items() if value is not None]
    if written:
        yield "walls:"
        yield from written


def _shape(shape: Shape, depth: str) -> str:
    match shape:
        case Circle():
            return f"Circle radius={shape.radius:.6g} m"
        case Polygon():
            corners = ", ".join(f"({x:.6g} m, {y:.6g} m)" for x, y in shape.points)
            return f"Polygon points:[{corners}]"
    return f"Rectangle width={shape.width:.6g} m, {depth}={shape.depth:.6g} m"


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"    {line}" if line else line for line in lines)
