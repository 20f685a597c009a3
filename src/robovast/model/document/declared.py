"""Gives values in a .vast document the types that they are meant to have.

YAML guesses types: it reads `12:30` as 750, `no` as false and `1.10` as 1.1. A parameter that the
scenario declares as `string` keeps the text of the file, and text is a number where a number is
declared. Parameters of unknown types keep what YAML reads. Environment variables and metadata have
no types: they keep the text of the file wherever YAML would change it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.model.document.source import KeyPath, Source
from robovast.model.scenario import Scenario, read_scenario
from robovast.model.scenario_values import as_declared

_LIST, _ONE_OF = "ParameterVariationList", "OneOfVariation"


def apply_types(source: Source, scenario: Scenario | None = None) -> list[tuple[KeyPath, str]]:
    """Replace values of parameters in a document's data, which may be invalid.

    Args:
        source: the document.
        scenario: declares the types; by default the one that the document names, if it can be read.

    Returns:
        Path of each value of a parameter, and of each replaced part of a value, with its name.
    """
    kept = [*_keep_spelling(source, ("execution", "env")), *_keep_spelling(source, ("metadata",))]
    scenario = scenario or _scenario(source)
    if scenario is None:
        return kept
    typing = _Typing(source, scenario)
    for path in (("execution", "local", "parameter_overrides"), ("search", "parameters")):
        typing.pairs(path)
    for index in _places(source.at(("configuration",))):
        typing.pairs(("configuration", index, "parameters"))
        typing.variations(("configuration", index, "variations"))
    typing.variations(("search", "variations"))
    typing.search_space(("search", "search_space"))
    return kept + typing.seen


def _keep_spelling(source: Source, path: KeyPath) -> Iterator[tuple[KeyPath, str]]:
    """Replace the values at a path by their text where YAML would write them in another way."""
    value, text = source.at(path), source.text(path)
    for part in _keys(value) or _places(value):
        yield from _keep_spelling(source, (*path, part))
    plain = str(value).lower() if isinstance(value, bool) else str(value)
    if text is not None and value is not None and text != plain:
        source.replace(path, text)
        yield path, str(path[-1])


def _scenario(source: Source) -> Scenario | None:
    places: list[KeyPath] = [("execution",)]
    places += (("configuration", n) for n in _places(source.at(("configuration",))))
    names = (source.at((*place, "scenario_file")) for place in places)
    name = next((name for name in names if isinstance(name, str)), None)
    try:
        return None if name is None else read_scenario(source.file.parent / Path(name))
    except (InputError, ValueError):  # reported where the document is checked
        return None


class _Typing:
    def __init__(self, source: Source, scenario: Scenario) -> None:
        self._source = source
        self._scenario = scenario
        self.seen: list[tuple[KeyPath, str]] = []
        self._names: dict[str, str] = {}
        """Parameters of the dimensions of a search that markers name."""

    def pairs(self, path: KeyPath) -> None:
        """A list of `name: value` pairs."""
        for place in _places(self._source.at(path)):
            for name in _keys(self._source.at((*path, place))):
                self._value((*path, place, name), name)

    def variations(self, path: KeyPath) -> None:
        """A list of variations."""
        for place in _places(self._source.at(path)):
            inner = (*path, place)
            self.variations((*inner, _ONE_OF, "variations"))
            name = self._source.at((*inner, _LIST, "name"))
            for row in _places(self._source.at((*inner, _LIST, "values"))):
                value: KeyPath = (*inner, _LIST, "values", row)
                if isinstance(name, str):
                    self._value(value, name)
                for column in _places(name):
                    self._value((*value, column), name[column])

    def search_space(self, path: KeyPath) -> None:
        """The choices of a search's dimensions, each for the parameter that gets them."""
        for name in _keys(self._source.at(path)):
            for place in _places(self._source.at((*path, name, "values"))):
                self._value((*path, name, "values", place), self._names.get(name, name))

    def _value(self, path: KeyPath, name: Any) -> None:
        value = self._source.at(path)
        if isinstance(value, str) and value.startswith("$"):
            self._names.setdefault(value.strip("${}"), name)
        elif isinstance(name, str):
            self.seen.append((path, name))
            for inner, typed in as_declared(self._scenario, name, value, self._texts(path)):
                self._source.replace((*path, *inner), typed)
                self.seen.append(((*path, *inner), name))

    def _texts(self, path: KeyPath) -> Any:
        return lambda inner: self._source.text((*path, *inner))


def _places(value: Any) -> Iterator[int]:
    yield from range(len(value)) if isinstance(value, list) else ()


def _keys(value: Any) -> list[Any]:
    return list(value) if isinstance(value, dict) else []
