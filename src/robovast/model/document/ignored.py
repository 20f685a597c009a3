"""Removes keys that have no effect from a document, with a warning for each.

Files of the existing tool contain such keys, because it ignored them silently. A key that looks
like a misspelt one remains an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from pydantic import ValidationError

from robovast.base.errors import Problem
from robovast.model.document.execution import CONTRACT_ENVIRONMENT
from robovast.model.document.model import Vast
from robovast.model.document.problems import allowed_keys, data_path, nearest
from robovast.model.document.source import KeyPath, Source

_STRICT = frozenset({"search"})
"""Sections in which unknown keys are errors."""


def without_ignored(source: Source) -> tuple[dict[Any, Any], list[Problem]]:
    """A document's data without ignored keys, and a warning for each removed key."""
    unknown = list(_unknown_keys(source))
    warnings = [_warning(source, path) for path in unknown]
    warnings += [_overridden(source, path) for path in contract_environment(source)]
    if source.is_followed:
        message = "only the first YAML document counts; text after `---` has no effect"
        warnings.append(source.problem((), message))
    data: dict[Any, Any] = deepcopy(source.data) if unknown else source.data
    for path in unknown:
        _remove(data, path)
    return data, warnings


def _warning(source: Source, path: KeyPath) -> Problem:
    return source.problem(path, f"the key `{path[-1]}` is not known and has no effect", at_key=True)


def _unknown_keys(source: Source) -> Iterator[KeyPath]:
    try:
        Vast.model_validate(source.data)
    except ValidationError as error:
        found = [
            details
            for details in error.errors(include_url=False, include_context=False)
            if details["type"] == "extra_forbidden"
        ]
    else:
        return
    for details in found:
        loc = details["loc"]
        path = data_path(source.data, (), loc)
        deep = len(loc) > 1 and loc[0] not in _STRICT
        if deep and not nearest(str(loc[-1]), allowed_keys(Vast, loc[:-1])):
            yield path


def _remove(data: Any, path: KeyPath) -> None:
    for part in path[:-1]:
        data = data[part]
    data.pop(path[-1], None)


def _overridden(source: Source, path: KeyPath) -> Problem:
    message = f"`{path[-1]}` is set by RoboVAST; the value in the file has no effect"
    return source.problem(path, message, at_key=True)


def contract_environment(source: Source) -> Iterator[KeyPath]:
    """Places where a document sets variables that belong to the run contract."""
    execution = source.data.get("execution")
    items = execution.get("env") if isinstance(execution, dict) else None
    for index, item in enumerate(items if isinstance(items, list) else ()):
        for name in CONTRACT_ENVIRONMENT.intersection(item if isinstance(item, dict) else ()):
            yield "execution", "env", index, name
