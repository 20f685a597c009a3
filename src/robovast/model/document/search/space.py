"""The values that a search may propose for its dimensions, and their place in the unit interval.

The unit interval is the common scale of all strategies: every dimension maps it to its values,
logarithmically where the document says so, choices as equal parts.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

from robovast.model.document.search.section import SearchDimension

Space = Mapping[str, SearchDimension]
Values = dict[str, Any]
_TICKS = 6
"""Values at an axis of numbers, if there are more."""


def set_id(values: Mapping[str, Any]) -> str:
    """Identifier of a parameter set: equal values have equal identifiers."""
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()[:12]


def choices(dimension: SearchDimension) -> list[Any] | None:
    """All values of a dimension that has no numbers; None for numbers."""
    if dimension.type == "bool":
        return [False, True]
    return list(dimension.values or ()) if dimension.type == "choice" else None


def parts(dimension: SearchDimension) -> int | None:
    """Number of equal parts of the unit interval that have a value each; None where it is not
    so divided."""
    values = choices(dimension)
    if values is not None:
        return len(values)
    return _raster(dimension) if dimension.type == "int" and not dimension.log else None


def at(dimension: SearchDimension, unit: float) -> Any:
    """The value at a place of the unit interval, whose ends count."""
    unit = min(max(float(unit), 0.0), 1.0)
    values = choices(dimension)
    if values is not None:
        return values[min(int(unit * len(values)), len(values) - 1)]
    if dimension.type == "int":
        return _integer_at(dimension, unit)
    low, high = _ends(dimension)
    number = math.exp(low + unit * (high - low)) if dimension.log else low + unit * (high - low)
    return min(max(number, float(dimension.low or 0)), float(dimension.high or 0))


def place(dimension: SearchDimension, value: Any) -> float:
    """The place of a value in the unit interval; of a part, its middle.

    Raises:
        ValueError: the dimension does not have that value.
    """
    if not holds(dimension, value):
        raise ValueError(f"{value!r} is not in the space")
    values = choices(dimension)
    if values is not None:
        return (_index(values, value) + 0.5) / len(values)
    if dimension.type == "int":
        return _integer_place(dimension, value)
    low, high = _ends(dimension)
    number = float(math.log(value) if dimension.log else value)
    return (number - low) / (high - low) if high > low else 0.5


def holds(dimension: SearchDimension, value: Any) -> bool:
    """Whether a dimension has a value; whole numbers of other types count as `int`."""
    values = choices(dimension)
    if values is not None:
        return _index(values, value) >= 0
    low, high = float(dimension.low or 0), float(dimension.high or 0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        return False
    return dimension.type == "float" or (
        float(value).is_integer() and (int(value) - int(low)) % (dimension.step or 1) == 0
    )


def size(space: Space) -> float:
    """Number of different parameter sets; infinite where a dimension is continuous."""
    return math.prod(_size(dimension) for dimension in space.values())


def values_at(space: Space, units: Mapping[str, float]) -> Values:
    """A parameter set from places in the unit interval."""
    return {name: at(dimension, units[name]) for name, dimension in space.items()}


def ticks(dimension: SearchDimension) -> list[tuple[float, str]]:
    """Places of the unit interval with the text of their values, as an axis has them."""
    count = parts(dimension)
    if count is None or (count > _TICKS and choices(dimension) is None):
        spots = [i / (_TICKS - 1) for i in range(_TICKS)]
    else:
        spots = [(i + 0.5) / count for i in range(count)]
    values = [(spot, at(dimension, spot)) for spot in spots]
    return [(spot, f"{v:.3g}" if isinstance(v, float) else str(v)) for spot, v in values]


def _size(dimension: SearchDimension) -> float:
    values = choices(dimension)
    if values is not None:
        return len(values)
    if dimension.type == "float":
        return 1 if dimension.low == dimension.high else math.inf
    return _raster(dimension)


def _raster(dimension: SearchDimension) -> int:
    """Number of values of an `int`."""
    return int((dimension.high or 0) - (dimension.low or 0)) // (dimension.step or 1) + 1


def _integer_at(dimension: SearchDimension, unit: float) -> int:
    """Each value of the raster has a part of its own: of equal length, or in scale with `log`."""
    low, step, count = int(dimension.low or 0), dimension.step or 1, _raster(dimension)
    if dimension.log:
        first, last = _log_ends(low, step, count)
        index = round((math.exp(first + unit * (last - first)) - low) / step)
    else:
        index = int(unit * count)
    return low + step * min(max(index, 0), count - 1)


def _integer_place(dimension: SearchDimension, value: float) -> float:
    low, step, count = int(dimension.low or 0), dimension.step or 1, _raster(dimension)
    if dimension.log:
        first, last = _log_ends(low, step, count)
        return (math.log(value) - first) / (last - first)
    return ((value - low) / step + 0.5) / count


def _log_ends(low: int, step: int, count: int) -> tuple[float, float]:
    """The ends of a raster, half a step beyond its first and last value where that is above 0."""
    return math.log(max(low - step / 2, low / 2)), math.log(low + step * (count - 0.5))


def _ends(dimension: SearchDimension) -> tuple[float, float]:
    low, high = float(dimension.low or 0), float(dimension.high or 0)
    return (math.log(low), math.log(high)) if dimension.log else (low, high)


def _index(values: list[Any], value: Any) -> int:
    """Position of a value; true is no 1."""
    same = (i for i, v in enumerate(values) if v == value and type(v) is type(value))
    return next(same, -1)
