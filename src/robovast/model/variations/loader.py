"""Finds variation types by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError, RobovastError
from robovast.base.plugins import load_plugin, split_file_reference
from robovast.model.variations import BUILT_IN_TYPES
from robovast.model.variations.base_variation import Variation

_BUILT_IN = {kind.__name__: kind for kind in BUILT_IN_TYPES}
"""Found without a look at all that is installed, for which each pod would pay."""

GROUP = "robovast.variation_types"


def load_variation(name: str, folder: str | Path) -> type[Variation]:
    """The class of a variation type.

    Args:
        name: an entry-point name, or `<path>.py:<Class>`.
        folder: the .vast file's folder.

    Raises:
        InputError: it does not exist, cannot be loaded, or is not a variation type.
        CannotRunError: a package that it imports is not installed.
    """
    found = _BUILT_IN.get(name) or load_plugin(name, GROUP, folder)
    if not (isinstance(found, type) and issubclass(found, Variation)):
        raise InputError(
            f"`{name}` is not a variation type",
            hint="write a class that inherits from robovast.common.variation.Variation",
        )
    return found


def is_pure(name: str, parameters: Any) -> bool:
    """Whether a variation type is pure; types in files are not, and are not loaded here.

    Unknown types and wrong parameters count as pure: they cannot be applied at all.
    """
    if split_file_reference(name) is not None:
        return False
    try:
        return load_variation(name, Path()).is_pure(parameters)
    except (RobovastError, ValueError, TypeError):
        return True


def most_of_each(name: str, parameters: Any, folder: str | Path) -> int:
    """Most configurations that a variation type makes from each given one; 1 if it cannot tell."""
    try:
        return load_variation(name, folder).most_of_each(parameters, str(folder)) or 1
    except (RobovastError, ValueError, TypeError):
        return 1  # making them reports the error


def levels(name: str, parameters: Any, folder: str | Path) -> int | None:
    """Number of values of a variation among which a design may choose; None if it may not."""
    try:
        return load_variation(name, folder).levels(parameters, str(folder))
    except (RobovastError, ValueError, TypeError):
        return None  # checking the variation reports the error


def all_pure(document: Mapping[str, object]) -> bool:
    """Whether all variation types of a document are pure, so that no user's code is executed.

    Args:
        document: plain data, which need not be a valid document.
    """
    entries = (e for e in _items(document.get("configuration")) if isinstance(e, dict))
    calls = (call for entry in entries for call in _items(entry.get("variations")))
    pairs = ([*call.items()] if isinstance(call, dict) else [(call, {})] for call in calls)
    return all(is_pure(str(name), parameters or {}) for call in pairs for name, parameters in call)


def _items(value: object) -> list[object]:
    """A list as it is; anything else, which checking the document refuses, as none."""
    return value if isinstance(value, list) else []
