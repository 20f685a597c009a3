"""Converts pydantic's validation errors to problems with a place, a cause and a remedy."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from robovast.base.errors import Problem
from robovast.model.document.execution import KINDS_OF_PACKS, KINDS_OF_RUNS
from robovast.model.document.source import KeyPath, Source


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
    problems = []
    values: dict[KeyPath, list[ErrorDetails]] = {}
    for details in error.errors(include_url=False):
        path = data_path(source.data, base, details["loc"])
        if details["type"] in {"missing", "extra_forbidden"}:
            problems.append(_key_problem(path, details, source, model))
        else:
            values.setdefault(path, []).append(details)
    return problems + [
        _value_problem(path, values[path], source, model) for path in _deepest(values)
    ]


def _deepest(paths: Iterable[KeyPath]) -> list[KeyPath]:
    """The paths that are not parents of others.

    A value that fails every member of a union has an error for each; the deepest tells the most.
    """
    parents = {path[:length] for path in paths for length in range(len(path))}
    return [path for path in paths if path not in parents]


def data_path(data: Any, base: KeyPath, loc: Iterable[str | int]) -> KeyPath:
    """The document's path of a pydantic location.

    A location also contains the names of union members, which the document does not have, and
    omits the name in a `name: {…}` item.
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


def _key_problem(
    path: KeyPath, details: ErrorDetails, source: Source, model: type[BaseModel]
) -> Problem:
    key = str(details["loc"][-1])
    if details["type"] == "missing":
        return source.problem(path, f"the key `{key}` is missing", _describe(model, details["loc"]))
    allowed = allowed_keys(model, details["loc"][:-1])
    return source.problem(path, f"unknown key `{key}`", suggest(key, allowed), at_key=True)


def _value_problem(
    path: KeyPath, group: list[ErrorDetails], source: Source, model: type[BaseModel]
) -> Problem:
    *loc, kind = group[0]["loc"] or ("",)
    known = (*loc, kind) if kind not in (*KINDS_OF_RUNS, *KINDS_OF_PACKS) else tuple(loc)
    return source.problem(path, sentence(*group), _describe(model, known))


def sentence(*group: ErrorDetails) -> str:
    """Say what a value must be, and what it is; a union may allow several kinds of value."""
    sentences = list(dict.fromkeys(map(_sentence, group)))
    message = " or ".join([sentences[0], *(s.removeprefix("must be ") for s in sentences[1:])])
    if not message.startswith("must ") or ", not " in message or message.endswith(" empty"):
        return message
    return f"{message}, not {_shown(group[0]['input'], whole='mapping' in message)}"


def nearest(given: str, allowed: Iterable[str]) -> str | None:
    """The allowed name most similar to the given one; None when no name is similar."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(given, sorted(allowed), n=1, cutoff=0.6)), None)


def suggest(given: str, allowed: Iterable[str]) -> str:
    """`Did you mean …?`, or the list of allowed names."""
    names = sorted(allowed)
    near = nearest(given, names)
    if near:
        return f"Did you mean `{near}`?"
    return f"Known here: {', '.join(names)}." if names else ""


def as_hint(remedy: str) -> str:
    """The remedy of a problem, for the hint of an error."""
    return remedy[:1].lower() + remedy[1:]


_EXPECTED = {
    "bool": "true or false",
    "dict": "a mapping",
    "float": "a number",
    "int": "a whole number",
    "list": "a list",
    "model": "a mapping",
    "string": "text",
    "tuple": "a list",
}
"""Expected kinds of value, by the first word of pydantic's error type."""

_WORDS = {
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "have at least 1 item, not 0": "be a list that is not empty",
    "have at least 1 character": "not be empty",
}
"""Pydantic's phrases and our replacements."""


def _sentence(details: ErrorDetails) -> str:
    kind, _, what = details["type"].partition("_")
    if kind in _EXPECTED and what in {"type", "parsing", "from_float"}:
        return f"must be {_EXPECTED[kind]}"
    if details["type"] == "invalid_key":
        return "keys must be text"
    if details["type"] == "string_pattern_mismatch":
        return f"must match {details['ctx']['pattern']}"
    message = details["msg"].removeprefix("Value error, ").replace(" after validation", "")
    message = re.sub(r"^[A-Z][a-z]+ should ", "must ", message)
    for theirs, ours in _WORDS.items():
        message = message.replace(theirs, ours)
    return message[:1].lower() + message[1:]


def _shown(value: Any, *, whole: bool = False) -> str:
    """A value, shortened for a message; a mapping is shown `whole` where mappings are allowed."""
    kinds = {dict: "a mapping", list: "a list", type(None): "empty"}
    text = kinds.get(type(value)) or repr(value)
    if whole and isinstance(value, dict):
        text = f"`{json.dumps(value, default=str)}`"
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


def allowed_keys(model: type[BaseModel], loc: tuple[str | int, ...]) -> list[str]:
    """The keys that the section at a pydantic location may have."""
    return list(_model_at(model, loc).model_fields)


def _describe(model: type[BaseModel], loc: tuple[str | int, ...]) -> str:
    field = _model_at(model, loc[:-1]).model_fields.get(str(loc[-1])) if loc else None
    return (field.description or "") if field else ""
