"""Factors: what a person varied, beside the scenario parameters that came of it.

A floor plan is a factor; the files of its map and mesh are parameters that follow from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robovast.base.serialization import to_plain

Scalar = str | int | float | bool | None

FACTORS = "_factors"
"""Key of a configuration for its factors: `{name: {value, unit}}`. While it is expanded, None
instead marks a parameter that follows from factors."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A value that a person varied."""

    value: Scalar
    unit: str = ""
    """Such as `m` or `1/m`; empty if there is none."""


def note_factors(
    config: dict[str, Any],
    values: Mapping[str, Any],
    factors: Mapping[str, Factor | Scalar] | None,
) -> None:
    """Note the factors of values that a variation sets; without any, the values are factors.

    Raises:
        TypeError: a factor is neither text nor number.
    """
    known = config.get(FACTORS, {})
    if factors is None and not known:
        return
    parameters = config.get("config", {})
    kept = {n: item for n, item in known.items() if n not in values or n not in parameters}
    taken = {*parameters, *values, *kept}
    noted = {_free(n, taken) if n in values else n: item for n, item in kept.items()}
    if factors is not None:
        noted |= dict.fromkeys(values)
    taken = {*parameters, *noted} - set(values)
    for name, given in (factors or {}).items():
        free = _free(name, taken)
        taken.add(free)
        noted[free] = _data(name, given)
    config[FACTORS] = noted


def all_factors(noted: Mapping[str, Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """All factors of a configuration: noted ones, and parameters that follow from none of them.

    Empty if they are just the parameters.
    """
    if not noted:
        return {}
    plain = {
        name: {"value": value}
        for name, value in parameters.items()
        if name not in noted and not name.startswith("_")
    }
    return {name: item for name, item in noted.items() if item is not None} | plain


def factor_values(factors: Any) -> dict[str, Any]:
    """Values of stored factors, by name; what has another form is left out."""
    return {str(name): item["value"] for name, item in _readable(factors)}


def factor_units(factors: Any) -> dict[str, str]:
    """Units of stored factors that have one."""
    return {str(name): str(item["unit"]) for name, item in _readable(factors) if item.get("unit")}


def _readable(factors: Any) -> list[tuple[Any, dict[str, Any]]]:
    items = factors.items() if isinstance(factors, dict) else ()
    return [(name, item) for name, item in items if isinstance(item, dict) and "value" in item]


def _free(name: str, taken: set[str]) -> str:
    """The name, with a number if another variation has it already."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name}_{number}"
    return found


def _data(name: str, given: Factor | Scalar) -> dict[str, Any]:
    factor = given if isinstance(given, Factor) else Factor(given)
    value = to_plain(factor.value)
    if not isinstance(value, Scalar):
        raise TypeError(
            f"the factor `{name}` must be text, a number or a truth value, "
            f"not {type(factor.value).__name__}"
        )
    return {"value": value} | ({"unit": factor.unit} if factor.unit else {})
