"""Keeps YAML's truth values out of numbers: Python and Pydantic take `true` for 1."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ConfigDict, model_validator


class StrictNumbers(BaseModel):
    """A model whose numbers cannot be written as `true` or `false`."""

    model_config = ConfigDict(defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _without_booleans(cls, data: Any) -> Any:
        """Spell truth values where only a number is allowed; they are refused like every word."""
        if not isinstance(data, dict) or not any(map(_holds_boolean, data.values())):
            return data
        numbers = _number_fields(cls)
        return {key: _spelled(value) if key in numbers else value for key, value in data.items()}


def _holds_boolean(value: Any) -> bool:
    return isinstance(value, bool) or (isinstance(value, list) and any(map(_holds_boolean, value)))


def _spelled(value: Any) -> Any:
    if isinstance(value, list):
        return [_spelled(item) for item in value]
    return str(value).lower() if isinstance(value, bool) else value


@lru_cache(maxsize=256)
def _number_fields(model: type[BaseModel]) -> frozenset[str]:
    fields = model.model_fields.items()
    names = {name: field.alias or name for name, field in fields}
    return frozenset(
        key
        for name, field in fields
        if _allows(field.annotation) >= {"number"} and not _allows(field.annotation) & {"boolean"}
        for key in (name, names[name])
    )


def _allows(annotation: Any) -> set[str]:
    if annotation is bool or annotation is Any or annotation is object:
        return {"boolean"}
    if annotation in (int, float):
        return {"number"}
    if get_origin(annotation) is dict:
        return set()
    if get_origin(annotation) is Literal:
        return {found for value in get_args(annotation) for found in _allows(type(value))}
    return {found for inner in get_args(annotation) for found in _allows(inner)}
