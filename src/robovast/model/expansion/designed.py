"""Applies an entry's design: keeps those of the configurations that it chooses, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.model.designs import Row
from robovast.model.document.model import ConfigurationEntry
from robovast.model.variations.loader import levels

Configs = list[dict[str, Any]]
_AT_ONCE = 10_000
"""Most configurations that a variation makes before those that are not needed are dropped."""


def design_sizes(entry: ConfigurationEntry, folder: Path) -> list[int]:
    """Number of values of each variation of an entry with a design, which was checked."""
    calls = entry.variations or []
    return [levels(call.name, call.parameters, folder) or 1 for call in calls]


class Chooser:
    """Drops the configurations that no chosen combination begins with, in each variation.

    So the product, which may be very large, is never made, nor that of the chosen ones with all
    values of the next variation.
    """

    def __init__(
        self, entry: ConfigurationEntry, sizes: Sequence[int], rows: Sequence[Row]
    ) -> None:
        self._name = entry.name
        self._sizes = sizes
        self._rows = rows
        self._prefixes: list[Row] = [()]

    def vary(self, configs: Configs, variation: Callable[[Configs], Configs]) -> Configs:
        """Those of the configurations that the next variation makes which are needed.

        It makes them of a few at a time.

        Raises:
            InputError: the variation makes another number than it has announced.
        """
        axis = len(self._prefixes[0])
        size = self._sizes[axis]
        wanted = {row[: axis + 1] for row in self._rows}
        few = max(1, _AT_ONCE // size)
        kept: list[tuple[Row, dict[str, Any]]] = []
        for first in range(0, len(configs), few):
            made = variation(configs[first : first + few])
            before = self._prefixes[first : first + few]
            places = [(*prefix, value) for prefix, value in product(before, range(size))]
            if len(made) != len(places):
                raise InputError(
                    f"configuration `{self._name}`: variation {axis + 1} created {len(made)} "
                    f"configurations, but its `levels` announced {len(places)}",
                    hint="let `levels` announce the number of configurations",
                )
            kept += [pair for pair in zip(places, made, strict=True) if pair[0] in wanted]
        self._prefixes = [prefix for prefix, _ in kept]
        return [config for _, config in kept]
