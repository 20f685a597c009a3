"""Finds strategies and extractors, and makes them from a document."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.plugins import plugin_errors, raised, shorten
from robovast.model.document import Document
from robovast.model.document.search.plugins import EXTRACTORS, STRATEGIES, load_search_plugin
from robovast.model.document.search.section import Search
from robovast.search.extractor import Extractor
from robovast.search.strategy import SearchStrategy

_TRACE = 4000
"""Most characters of a traceback: the file with a batch's scores must stay readable."""


def search_of(document: Document) -> Search:
    """The document's search.

    Raises:
        InputError: it has none.
    """
    if document.vast.search is None:
        raise InputError(
            f"{document.path}: has no `search`.", hint="name a .vast file with a `search`"
        )
    return document.vast.search


def make_strategy(document: Document) -> SearchStrategy:
    """The strategy before its first batch.

    Raises:
        InputError: it cannot be loaded or made.
    """
    return strategy_of(search_of(document), document.path)


def strategy_of(search: Search, document: Path) -> SearchStrategy:
    """The strategy of a search in the document at a path; see `make_strategy`."""
    kind = load_search_plugin(search.strategy, STRATEGIES, document.parent)
    model = getattr(kind, "PARAMS_MODEL", None)
    given: Any = dict(search.strategy_parameters)
    what = f"the strategy `{search.strategy}`"
    with plugin_errors(lambda error: _cannot_be_made(document, what, error)):
        made = kind(search, given if model is None else model.model_validate(given))
    strategy: SearchStrategy = _checked(made, SearchStrategy, search.strategy, "strategy")
    return strategy


def make_extractor(document: Document) -> Extractor:
    """The extractor.

    Raises:
        InputError: it cannot be loaded or made.
    """
    name, params = search_of(document).extract.call
    kind = load_search_plugin(name, EXTRACTORS, document.folder)
    what = f"the extractor `{name}`"
    with plugin_errors(lambda error: _cannot_be_made(document.path, what, error)):
        made = kind(**params)
    extractor: Extractor = _checked(made, Extractor, name, "extractor")
    return extractor


def trace(error: BaseException) -> str:
    """The traceback of a plugin's error, its middle left out where it is long."""
    return shorten("".join(traceback.format_exception(error)), _TRACE)


def _cannot_be_made(document: Path, what: str, error: BaseException) -> InputError:
    return InputError(f"{document}: {what} cannot be created: {raised(error)}")


def _checked(made: Any, kind: Any, name: str, what: str) -> Any:
    if not isinstance(made, kind):
        raise InputError(
            f"`{name}` is not a valid {what}",
            hint=f"write a class that inherits from {kind.__module__}.{kind.__name__}",
        )
    return made
