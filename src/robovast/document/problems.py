"""Validation errors of pydantic as problems with a place, a cause and a remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from robovast.document.source import KeyPath, Source
from robovast.errors import Problem


def problems_of(
    error: ValidationError, source: Source, model: type[BaseModel], base: KeyPath = ()
) -> list[Problem]:
    """Every problem in a validation error, one for each place in the document.

    Args:
        error: what validating the value at `base` raised.
        source: the document that the value came from.
        model: the model that the value was validated against.
        base: path of the validated value in the document.
    """
    by_path: dict[KeyPath, list[ErrorDetails]] = {}
    for details in error.errors(include_url=False):
        path = _data_path(source.data, base, details["loc"])
        by_path.setdefault(path, []).append(details)
    return [_problem(path, group, source, model) for path, group in by_path.items()]


def _data_path(data: Any, base: KeyPath, loc: Iterable[str | int]) -> KeyPath:
    """The document's path of a pydantic location.

    A location also names the members of unions, which are no part of the document, and skips
    the name in a `name: {…}` item.
    """
    path: KeyPath = ()
    for part in base:
        data, path = data[part], (*path, part)
    for part in loc:
        if isinstance(data, dict) and part not in data and len(data) == 1:
            ((name, inner),) = data.items()
            if isinstance(inner, dict) and part in inner:
                data, path = inner, (*path, name)
        if _holds(data, part):
            data, path = data[part], (*path, part)
    return path


def _holds(data: Any, part: str | int) -> bool:
    if isinstance(data, list):
        return isinstance(part, int) and part < len(data)
    return isinstance(data, dict) and part in data


def _problem(
    path: KeyPath, group: list[ErrorDetails], source: Source, model: type[BaseModel]
) -> Problem:
    first = group[0]
    kind = first["type"]
    if kind == "missing":
        missing = str(first["loc"][-1])
        return source.problem(
            path, f"the key `{missing}` is missing", _describe(model, first["loc"])
        )
    if kind == "extra_forbidden":
        allowed = _allowed_keys(model, first["loc"][:-1])
        return source.problem(
            path, f"unknown key `{path[-1]}`", suggest(str(path[-1]), allowed), at_key=True
        )
    messages = list(dict.fromkeys(_sentence(details) for details in group))
    return source.problem(path, f"{' or '.join(messages)}, not {_shown(first['input'])}")


def suggest(given: str, allowed: Iterable[str]) -> str:
    """`Did you mean …?`, or the list of what is allowed."""
    names = sorted(allowed)
    near = difflib.get_close_matches(given, names, n=1, cutoff=0.6)
    if near:
        return f"Did you mean `{near[0]}`?"
    return f"Known here: {', '.join(names)}." if names else ""


def _sentence(details: ErrorDetails) -> str:
    message = details["msg"]
    for prefix in ("Input should be ", "Value error, "):
        message = message.removeprefix(prefix)
    if details["msg"].startswith("Input should be "):
        return f"must be {message}"
    return message[:1].lower() + message[1:] if message[:1].isupper() else message


def _shown(value: Any) -> str:
    text = {dict: "a mapping", list: "a list", type(None): "empty"}.get(type(value)) or repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models_in(argument)]


def _model_at(model: type[BaseModel], loc: Iterable[str | int]) -> type[BaseModel]:
    for part in loc:
        field = model.model_fields.get(str(part))
        inner = _models_in(field.annotation) if field else []
        model = inner[0] if inner else model
    return model


def _allowed_keys(model: type[BaseModel], loc: tuple[str | int, ...]) -> list[str]:
    return list(_model_at(model, loc).model_fields)


def _describe(model: type[BaseModel], loc: tuple[str | int, ...]) -> str:
    field = _model_at(model, loc[:-1]).model_fields.get(str(loc[-1]))
    return (field.description or "") if field else ""
