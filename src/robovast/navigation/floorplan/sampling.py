"""Varying a floor plan: reading .variation files, and drawing plans by their distributions."""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.errors import DocumentError, Problem
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.model import (
    Circle,
    Feature,
    FloorPlan,
    Opening,
    Rectangle,
    Shape,
    Space,
)
from robovast.navigation.floorplan.parser import UNITS, Source, kind

ATTEMPTS = 100
"""How often a plan is drawn until one is sound."""

Draw = Callable[[random.Random], float]

_FILLERS = frozenset({"location", "pose", "transformation", "defaults"})
"""Parts of an attribute's name that say nothing: versions of the language differ in them."""

_SIZES = frozenset({"width", "depth", "radius", "height", "wall_thickness", "wall_height"})


@dataclass(frozen=True)
class _Entry:
    """One attribute that varies."""

    path: tuple[str, ...]
    """Name of an element: a space, an opening, or a space and its feature."""
    attribute: tuple[str, ...]
    draw: Draw


@dataclass(frozen=True)
class PlanVariation:
    """What varies in a floor plan."""

    base: Path
    """Its model."""
    entries: tuple[_Entry, ...]

    def draw(self, plan: FloorPlan, rng: random.Random) -> FloorPlan:
        """A sound plan; equal generators give equal plans.

        Raises:
            DocumentError: none of ATTEMPTS was sound; says what was wrong with the last.
        """
        last = DocumentError([])
        for _ in range(ATTEMPTS):
            drawn = copy.deepcopy(plan)
            try:
                for entry in self.entries:
                    _set(drawn, entry, entry.draw(rng))
                lay_out(drawn)
            except DocumentError as error:
                last = error
            else:
                return drawn
        raise last


def read_variation(
    path: Path, read: Callable[[Path], FloorPlan]
) -> tuple[FloorPlan, PlanVariation]:
    """A .variation file, and the plan that it imports.

    Args:
        path: the file.
        read: reads the model that it imports.

    Raises:
        InputError: the file or the model cannot be read.
        DocumentError: everything that is wrong in it, with line and column.
    """
    source = Source(path, "variation.tx")
    base = (path.parent / source.model.file).resolve()
    plan = read(base)
    entries = tuple(
        _Entry(
            tuple(target.name.split(".")),
            _attribute(entry.attribute),
            _distribution(source, entry.distribution),
        )
        for target in source.model.targets
        for entry in target.entries
        if _exists(source, plan, target, entry)
    )
    source.finish()
    return plan, PlanVariation(base, entries)


def _exists(source: Source, plan: FloorPlan, target: Any, entry: Any) -> bool:
    element = _element(plan, target.name.split("."))
    if element is None:
        source.problem(
            target,
            f"the floor plan `{plan.name}` has no `{target.name}`",
            f"It has: {', '.join(_names(plan))}.",
        )
        return False
    found = _slot(element, _attribute(entry.attribute))
    if found is None:
        source.problem(
            entry,
            f"`{entry.attribute}` of `{target.name}` cannot be varied",
            f"These can: {', '.join(_attributes(element))}.",
        )
    return found is not None


def _distribution(source: Source, node: Any) -> Draw:
    match kind(node):
        case "Normal":
            mean, std = _number(node.mean), _number(node.std)
            if std < 0:
                source.problem(node, "`std` must not be below 0")
            return lambda rng: rng.gauss(mean, std)
        case "Uniform":
            values = [_number(value) for value in node.values]
            return lambda rng: rng.choice(values)
    weights = [option.weight for option in node.options]
    choices = [_number(option.value) for option in node.options]
    if min(weights) < 0 or not math.isclose(sum(weights), 1.0, abs_tol=1e-6):
        source.problem(node, f"the weights must sum to 1, not {sum(weights):g}")
    return lambda rng: rng.choices(choices, [max(weight, 0.0) for weight in weights])[0]


def _number(node: Any) -> float:
    return float(node.number) * UNITS[node.unit or "m"]


def _attribute(name: str) -> tuple[str, ...]:
    parts = name.replace("wall_thickness", "wall.thickness").replace("wall_height", "wall.height")
    return tuple(part for part in parts.split(".") if part not in _FILLERS)


def _set(plan: FloorPlan, entry: _Entry, value: float) -> None:
    element = _element(plan, entry.path)
    slot = _slot(element, entry.attribute)
    if element is None or slot is None:  # `read_variation` has refused it
        return
    owner, name = slot
    if name in _SIZES and value <= 0:
        what = f"`{element.name}` would have a {name.replace('_', ' ')} of {value:.3g} m"
        raise DocumentError([Problem(element.place, "", what)])
    setattr(owner, name, value)


def _slot(element: Any, attribute: tuple[str, ...]) -> tuple[Any, str] | None:
    """The object that has an attribute, and its name there."""
    match attribute:
        case ("translation", "x" | "y" | "z" as axis):
            return element.location, axis
        case ("rotation",) | ("rotation", "x" | "y" | "z"):
            return element.location, "rotation"
        case ("shape", side) if side in _sides(element.shape):
            return element.shape, _sides(element.shape)[side]
        case ("height",) if isinstance(element, Feature):
            return element, "height"
        case ("wall" | "walls", "thickness" | "height" as size) if isinstance(element, Space):
            return element, f"wall_{size}"
    return None


def _sides(shape: Shape) -> dict[str, str]:
    match shape:
        case Rectangle():
            return {"width": "width", "length": "depth", "height": "depth"}
        case Circle():
            return {"radius": "radius"}
    return {}


def _attributes(element: Any) -> Iterable[str]:
    yield from ("location.translation.x", "location.translation.y", "location.rotation.z")
    yield from (f"shape.{side}" for side in _sides(element.shape))
    if isinstance(element, Feature):
        yield "height"
    if isinstance(element, Space):
        yield from ("walls.thickness", "walls.height")


def _element(plan: FloorPlan, path: Iterable[str]) -> Space | Opening | Feature | None:
    first, *rest = path
    elements: list[Space | Opening] = [*plan.spaces, *plan.openings]
    named = next((element for element in elements if element.name == first), None)
    if not rest:
        return named
    features = named.features if isinstance(named, Space) else []
    return next((feature for feature in features if [feature.name] == rest), None)


def _names(plan: FloorPlan) -> Iterable[str]:
    for space in plan.spaces:
        yield space.name
        yield from (f"{space.name}.{feature.name}" for feature in space.features)
    yield from (opening.name for opening in plan.openings)
