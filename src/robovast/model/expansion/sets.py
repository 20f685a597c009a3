"""The configurations of a search's parameter sets."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from robovast.model.document import Document
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import Values, choices, values_at
from robovast.model.document.search.template import entry_of


def with_sets(document: Document, search: Search, sets: Iterable[Mapping[str, Any]]) -> Document:
    """The document with the configurations of parameter sets in place of its search."""
    update = {"configuration": [entry_of(search, values) for values in sets], "search": None}
    return dataclasses.replace(document, vast=document.vast.model_copy(update=update))


def with_all_files(document: Document) -> Document:
    """The document with configurations that need all files of its search, if it has one.

    Only a choice can name files: each of its values stands in one of them.
    """
    search = document.vast.search
    if search is None:
        return document
    sets = {entry_of(search, values).name: values for values in _samples(search)}
    return with_sets(document, search, sets.values())


def _samples(search: Search) -> Iterator[Values]:
    space = search.search_space
    middle = values_at(space, dict.fromkeys(space, 0.5))
    yield middle
    for name, dimension in space.items():
        for value in choices(dimension) or ():
            yield {**middle, name: value}
