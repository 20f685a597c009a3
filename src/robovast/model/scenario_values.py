"""Which values scenario-execution accepts for the parameters of a scenario.

It compares a value with the declared type, and with the form of the default: a default such as `1m`
takes whole numbers only, `1.0m` any number.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from typing import Any

from robovast.base.serialization import to_plain
from robovast.model.scenario import Scenario, ScenarioParameter

_PHYSICAL = frozenset(
    {"length", "time", "speed", "acceleration", "jerk", "angle", "angular_rate", "mass"}
    | {"angular_acceleration"}
)
"""Types with a unit; other ones of the standard library cannot be set without a default."""
_AMOUNT = re.compile(r"[+-]?\d+(?P<fraction>\.\d+)?[a-z]\w*", re.IGNORECASE)
"""A default with a unit."""
_DECIMAL = re.compile(r"[-+]?(?=[^eE]*[0-9])[0-9]*(?:\.[0-9]*(?:[eE][-+]?[0-9]+)?|[eE][-+]?[0-9]+)")
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,3999})")
_WITHOUT_DIGITS = re.compile(r"[-+]?\.inf|\.nan", re.IGNORECASE)
_GROUPED = re.compile(r"[-+]?(?:0x[0-9a-fA-F_]+|0b[01_]+|[1-9][0-9_]*(?:\.[0-9_]*)?)")
"""Other spellings that YAML 1.1 and people read alike, such as `0x10` and `1_000`."""
_TRUTHS = {
    **dict.fromkeys(("yes", "true", "on"), True),
    **dict.fromkeys(("no", "false", "off"), False),
}
_Path = tuple[str | int, ...]
_WHOLE, _NUMBER = "a whole number", "a number"
_KINDS: Mapping[str, type | tuple[type, ...]] = {
    _WHOLE: int,  # which `true` is, too
    _NUMBER: (int, float),
    "true or false": bool,
}
_OF_TYPES = {"int": _WHOLE, "uint": _WHOLE, "float": _NUMBER, "bool": "true or false"}


def _fields(kind: str, *names: str) -> tuple[ScenarioParameter, ...]:
    return tuple(ScenarioParameter(name, kind, None, 0) for name in names)


_STANDARD: Mapping[str, tuple[ScenarioParameter, ...]] = {
    "position_3d": _fields("length", "x", "y", "z"),
    "orientation_3d": _fields("angle", "roll", "pitch", "yaw"),
    "pose_3d": (*_fields("position_3d", "position"), *_fields("orientation_3d", "orientation")),
}
"""Fields of structures of the standard library."""


def refusal(scenario: Scenario, name: str, value: Any) -> str | None:
    """Why scenario-execution refuses a value, as `<parameter> must be …, not …`.

    None if it does not, if the scenario has no such parameter, or if the type is not known here.
    """
    found = scenario.parameter(name)
    structs = {**_STANDARD, **scenario.structs}
    return _refusal(found, value, name, structs) if found is not None else None


def as_declared(
    scenario: Scenario, name: str, value: Any, text: Callable[[_Path], str | None]
) -> Iterator[tuple[_Path, Any]]:
    """Parts of a value that have another type than the scenario declares, with the right value.

    Where a number is declared, an ambiguous spelling, such as `010`, becomes its text, which
    `refusal` refuses.

    Args:
        scenario: declares the parameter; an unknown one has no type.
        name: of the parameter.
        value: its value, as YAML reads it.
        text: gives the text of a part of the value that YAML does not read as text, else None.
    """
    found = scenario.parameter(name)
    if found is not None:
        yield from _declared(found, value, (), text, {**_STANDARD, **scenario.structs})


def _declared(
    parameter: ScenarioParameter,
    value: Any,
    path: _Path,
    text: Callable[[_Path], str | None],
    structs: Mapping[str, tuple[ScenarioParameter, ...]],
) -> Iterator[tuple[_Path, Any]]:
    *is_list, kind = parameter.type.split()
    if is_list and isinstance(value, list):
        item = ScenarioParameter(parameter.name, kind, None, parameter.line)
        for place, inner in enumerate(value):
            yield from _declared(item, inner, (*path, place), text, structs)
    elif kind in structs and isinstance(value, dict):
        for field in structs[kind]:
            if field.name in value:
                inner = value[field.name]
                yield from _declared(field, inner, (*path, field.name), text, structs)
    else:
        typed = _typed(_expected(kind, parameter.default_text), value, text(path), kind)
        if typed is not None:
            yield path, typed


def _typed(expected: str | None, value: Any, spelt: str | None, kind: str) -> Any:
    """What replaces a value that is neither a list nor a structure; None if it stays."""
    if kind == "string":
        return spelt
    if isinstance(value, str):
        return _number_in(value, expected)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and expected in (_WHOLE, _NUMBER) and spelt and not _is_unambiguous(spelt):
        return spelt
    return None


def _is_unambiguous(text: str) -> bool:
    """Whether YAML reads a number as people do; it reads `010` as 8 and `1:30` as 90."""
    others = _WITHOUT_DIGITS.fullmatch(text) or _GROUPED.fullmatch(text)
    return _number_in(text, _NUMBER) is not None or others is not None


def _number_in(text: str, expected: str | None) -> int | float | None:
    """The number or truth value of a text, where one is expected."""
    if expected == _NUMBER and _DECIMAL.fullmatch(text):
        return float(text) if isfinite(float(text)) else None
    if expected in (_WHOLE, _NUMBER) and _INTEGER.fullmatch(text):
        return int(text)
    return _TRUTHS.get(text.lower()) if expected == "true or false" else None


def declaration(scenario: Scenario, name: str) -> str:
    """Where and how a scenario declares a parameter, as `drive.osc:3 declares `speed: float``."""
    found = scenario.parameter(name)
    if found is None:
        return ""
    default = f" = {found.default_text}" if found.default_text is not None else ""
    return f"{scenario.file}:{found.line} declares `{name}: {found.type}{default}`"


def is_plain(scenario: Scenario, name: str) -> bool:
    """Whether a parameter is a number, a truth value or a text."""
    found = scenario.parameter(name)
    return found is not None and found.type in {*_OF_TYPES, *_PHYSICAL, "string"}


def _refusal(
    parameter: ScenarioParameter,
    value: Any,
    place: str,
    structs: Mapping[str, tuple[ScenarioParameter, ...]],
) -> str | None:
    *is_list, kind = parameter.type.split()
    if is_list:
        if not isinstance(value, list):
            return _sentence(place, "a list", value)
        item = ScenarioParameter(parameter.name, kind, None, parameter.line)
        each = (_refusal(item, v, f"{place}[{i}]", structs) for i, v in enumerate(value))
        return next(filter(None, each), None)
    if kind in structs:
        return _structure(structs[kind], value, place, structs)
    expected = _expected(kind, parameter.default_text)
    if expected is None or isinstance(value, _KINDS[expected]):
        return None
    default = "" if kind in _OF_TYPES else f", as its default `{parameter.default_text}` is"
    is_spelling = isinstance(value, str) and re.fullmatch(r"[-+]?[0-9][0-9a-fxo:._+-]*", value)
    odd = is_spelling and not _is_unambiguous(value)
    form = " in decimal digits, such as `10`" if odd else ""
    return _sentence(place, expected + form + (default if expected == _WHOLE else ""), value)


def _expected(kind: str, default: str | None) -> str | None:
    """What values must be; None for texts, which anything is, and for unknown types."""
    amount = _AMOUNT.fullmatch(default or "")
    if kind not in _OF_TYPES and amount:
        return _NUMBER if amount["fraction"] else _WHOLE
    return _NUMBER if kind in _PHYSICAL and default is None else _OF_TYPES.get(kind)


def _structure(
    fields: tuple[ScenarioParameter, ...],
    value: Any,
    place: str,
    structs: Mapping[str, tuple[ScenarioParameter, ...]],
) -> str | None:
    known = {field.name: field for field in fields}
    if not isinstance(value, dict):
        return _sentence(place, f"a mapping of {', '.join(known) or 'nothing'}", value)
    for key, inner in value.items():
        if key not in known:
            return f"`{place}` has no field `{key}`, but {', '.join(known) or 'none'}"
        why = _refusal(known[key], inner, f"{place}.{key}", structs)
        if why is not None:
            return why
    return None


def _sentence(place: str, expected: str, value: Any) -> str:
    text = json.dumps(to_plain(value), default=str, ensure_ascii=False)
    return f"`{place}` must be {expected}, not {text if len(text) <= 60 else text[:57] + '…'}"
