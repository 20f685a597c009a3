"""`random`: sets drawn uniformly from the space, each at most once."""

from __future__ import annotations

from collections.abc import Container
from random import Random

from robovast.model.document.search.space import Space, at
from robovast.search.strategy import HistoryStrategy
from robovast.search.types import ParamSet

_TRIES = 1000
"""Draws in a row that may give known sets before the space counts as exhausted."""


class RandomStrategy(HistoryStrategy):
    """Draws every dimension uniformly, logarithmically where the document says so."""

    def propose(self, n: int) -> list[ParamSet]:
        """Draw sets that were never proposed."""
        generator = Random(f"{self.cfg.seed}/{self.batch}")  # noqa: S311  # not for secrets
        return draw_new(self.search_space, generator, n, self.asked)


def draw_new(space: Space, generator: Random, n: int, known: Container[str]) -> list[ParamSet]:
    """At most `n` sets, drawn uniformly; none of them is known."""
    found: dict[str, ParamSet] = {}
    tries = 0
    while len(found) < n and tries < _TRIES:
        drawn = ParamSet({name: at(dim, generator.random()) for name, dim in space.items()})
        tries += 1
        if drawn.id not in known and drawn.id not in found:
            found[drawn.id] = drawn
            tries = 0
    return list(found.values())
