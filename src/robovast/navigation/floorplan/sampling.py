"""Variation of floor plans: reads .variation files and draws plans from their distributions."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.random import RandomState

from robovast.base.errors import DocumentError
from robovast.navigation.floorplan.language import Model
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.model import FloorPlan
from robovast.navigation.floorplan.omitted_numbers import add_number
from robovast.navigation.floorplan.parser import ANGLES, UNITS, ParsedFile, kind

ATTEMPTS = 100
"""Most attempts to draw a valid plan."""

Draw = Callable[[RandomState], tuple[float, str]]
"""A number, and optionally its unit."""

_FILLERS = frozenset({"pose", "transformation"})
"""Parts of attribute names that are ignored, since versions of the language differ in them."""


@dataclass(frozen=True)
class _Entry:
    """A number of the model that varies."""

    node: Any
    """The node with the number and an optional unit: a value or a variable."""
    draw: Draw

    def set(self, rng: RandomState) -> None:
        """Replace the number; a number without a unit keeps the previous unit."""
        number, unit = self.draw(rng)
        own = self.node.unit
        self.node.number = number * UNITS[unit] / UNITS[own or "m"] if unit else number


@dataclass(frozen=True)
class PlanVariation:
    """The variations of a floor plan."""

    model: Model
    """The model, which changes with each draw."""
    entries: tuple[_Entry, ...]

    def draw(self, seed: int) -> FloorPlan:
        """Draw a valid plan; equal seeds give equal plans (NumPy's legacy generator).

        Args:
            seed: from 0 to 2**32 - 1.

        Raises:
            DocumentError: no attempt was valid; the message describes the last one.
        """
        rng = RandomState(seed)
        last = DocumentError([])
        for _ in range(ATTEMPTS):
            for entry in self.entries:
                entry.set(rng)
            try:
                plan = self.model.plan()
                lay_out(plan)
            except DocumentError as error:
                last = error
            else:
                return plan
        raise last


def read_variation(path: Path) -> PlanVariation:
    """Read a .variation file and the model that it imports.

    Args:
        path: the file.

    Raises:
        InputError: the file or the model cannot be read.
        DocumentError: all its errors, with line and column.
    """
    source = ParsedFile(path, "variation.tx")
    model = Model(Path(os.path.abspath(path.parent / source.model.file)))  # any name
    model.plan()
    entries = tuple(e for target in source.model.targets for e in _entries(source, model, target))
    source.finish()
    return PlanVariation(model, entries)


def _entries(source: ParsedFile, model: Model, target: Any) -> Iterator[_Entry]:
    element = _element(model.root, target.name.split("."))
    if element is None:
        source.problem(
            target,
            f"the floor plan `{model.root.name}` has no `{target.name}`",
            f"It has: {', '.join(_names(model.root))}.",
        )
    elif kind(element) == "Variable":
        if target.distribution is not None:  # braces have no effect on a variable
            angle = element.unit in ANGLES if element.unit else None
            yield _Entry(element, _distribution(source, target.distribution, angle))
    elif target.distribution is not None:
        source.problem(
            target, (f"`{target.name}` is not a variable: name one of its attributes in braces")
        )
    else:
        for entry in target.entries:
            yield from _entry(source, model, target.name, element, entry)


def _entry(
    source: ParsedFile, model: Model, name: str, element: Any, entry: Any
) -> Iterator[_Entry]:
    numbers = dict(_numbers(element, model.root))
    attribute = _attribute(entry.attribute)
    draw = _distribution(source, entry.distribution, attribute.startswith("location.rotation"))
    value = numbers.get(attribute) or add_number(element, attribute)
    if value is None:
        source.problem(
            entry,
            f"`{entry.attribute}` of `{name}` cannot be varied",
            f"These can: {', '.join(numbers)}, and where it is.",
        )
    elif not value.variable:  # references to variables stay unchanged
        yield _Entry(value, draw)


def _distribution(source: ParsedFile, node: Any, angle: bool | None) -> Draw:
    """How to draw numbers, of angles or lengths; None: of both, as nothing says what they are."""
    for number in _numbers_in(node):
        if number.unit and angle is not None and (number.unit in ANGLES) != angle:
            wanted = "an angle in deg or rad" if angle else "a length in m, cm or mm"
            source.problem(number, f"{wanted} is needed here, not a value in {number.unit}")
    match kind(node):
        case "Normal":
            mean, std = float(node.mean.number), float(node.std.number)
            if std < 0:
                source.problem(node, "`std` must not be below 0")
            return lambda rng: (round(float(rng.normal(mean, abs(std))), 2), node.mean.unit)
        case "Uniform":
            values = [(float(value.number), value.unit) for value in node.values]
            return lambda rng: values[rng.randint(0, len(values))]
    weights = [float(option.weight) for option in node.options]
    choices = [(float(option.value.number), option.value.unit) for option in node.options]
    if min(weights) < 0 or not math.isclose(sum(weights), 1.0, abs_tol=1e-6):
        source.problem(node, f"the weights must sum to 1, not {sum(weights):g}")
    total = sum(weights)  # NumPy allows less of a difference from 1
    return lambda rng: choices[rng.choice(len(choices), p=[weight / total for weight in weights])]


def _numbers_in(distribution: Any) -> list[Any]:
    match kind(distribution):
        case "Normal":
            return [distribution.mean, distribution.std]
        case "Uniform":
            return list(distribution.values)
    return [option.value for option in distribution.options]


def _attribute(name: str) -> str:
    """The name of an attribute without the parts that differ between versions."""
    name = name.removeprefix("defaults.").replace("walls.", "wall.").replace("wall_", "wall.")
    parts = [part for part in name.split(".") if part not in _FILLERS]
    return ".".join(["location", *parts] if parts[0] in {"translation", "rotation"} else parts)


def _numbers(element: Any, root: Any) -> Iterator[tuple[str, Any]]:
    """The numbers of an element by attribute name."""
    sizes = [size for item in root.items if kind(item) == "Defaults" for size in _sizes(item)]
    if kind(element) == "Space":
        yield from ((f"wall.{size.key}", size.value) for size in [*sizes, *_sizes(element)])
    for part in element.parts:
        match kind(part):
            case "ShapeOf" if kind(part.shape) == "RectangleShape":
                yield from ((f"shape.{side.key}", side.value) for side in part.shape.sides)
            case "ShapeOf" if kind(part.shape) == "CircleShape":
                yield "shape.radius", part.shape.value
            case "Height":
                yield "height", part.value
            case "Location":
                yield from _located(part)


def _sizes(node: Any) -> list[Any]:
    return [size for part in node.parts if kind(part) == "Walls" for size in part.sizes]


def _located(location: Any) -> Iterator[tuple[str, Any]]:
    for part in location.parts:
        if kind(part) in {"Translation", "Rotation"}:
            name = f"location.{kind(part).lower()}"
            yield from ((f"{name}.{axis.key}", axis.value) for axis in part.axes)


def _element(root: Any, path: list[str]) -> Any:
    """A space, opening, feature or variable by name, or None."""
    first, *rest = path
    named = [item for item in root.items if kind(item) != "Defaults" and item.name == first]
    named.sort(key=lambda item: kind(item) == "Variable")
    if not named or not rest:
        return next(iter(named), None)
    features = [feature for feature in _features(named[0]) if [feature.name] == rest]
    return next(iter(features), None)


def _features(item: Any) -> list[Any]:
    if kind(item) != "Space":
        return []
    return [f for part in item.parts if kind(part) == "Features" for f in part.features]


def _names(root: Any) -> Iterable[str]:
    for item in root.items:
        if kind(item) != "Defaults":
            yield item.name
            yield from (f"{item.name}.{feature.name}" for feature in _features(item))
