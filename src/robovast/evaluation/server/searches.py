"""Responses about searches."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from robovast.base.errors import InputError
from robovast.evaluation.launch.commands import more_batches
from robovast.evaluation.library import Library
from robovast.evaluation.searches import Searches, ShownSearch
from robovast.evaluation.server.answers import Data


class SearchPages:
    """Responses about the searches of a results folder."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._searches = Searches(library)

    @property
    def routes(self) -> list[Route]:
        """What is answered."""
        return [
            Route("/search/{campaign}", self.overview),
            Route("/search/{campaign}/sets", self.sets),
            Route("/search/{campaign}/map", self.map),
        ]

    def overview(self, request: Request) -> Response:
        """How far a search is, and what it looks for."""
        summary = self._library.summary(request.path_params["campaign"])
        more = more_batches(self._library.results, summary)
        return Data({"version": summary.version, "more": more, **self._of(request).overview})

    def sets(self, request: Request) -> Response:
        """All evaluated sets over the axes `x` and `y`."""
        return Data(self._of(request).sets(*_axes(request)))

    def map(self, request: Request) -> Response:
        """The failure map over `x` and `y`, at the place `at` of all others."""
        return Data(self._of(request).map(*_axes(request), _units(request)))

    def _of(self, request: Request) -> ShownSearch:
        return self._searches.of(request.path_params["campaign"])


def _axes(request: Request) -> tuple[str, str]:
    asked: Mapping[str, str] = request.query_params
    return asked.get("x", ""), asked.get("y", "")


def _units(request: Request) -> dict[str, float]:
    """Places in the unit interval by name, as JSON.

    Raises:
        InputError: it is something else.
    """
    text = request.query_params.get("at") or "{}"
    try:
        asked: Any = json.loads(text)
        found = {str(name): float(unit) for name, unit in asked.items()}
    except (ValueError, OverflowError, TypeError, AttributeError, RecursionError):
        found = {"": math.nan}
    if not all(0 <= unit <= 1 for unit in found.values()):
        raise InputError(f"{text:.80}: is not a valid position in a search.")
    return found
