"""Applies an entry's design: keeps those of the configurations that it chooses, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.model.designs import Row
from robovast.model.document.model import ConfigurationEntry
from robovast.model.variations.loader import levels


def design_sizes(entry: ConfigurationEntry, folder: Path) -> list[int]:
    """Number of values of each variation of an entry with a design, which was checked."""
    calls = entry.variations or []
    return [levels(call.name, call.parameters, folder) or 1 for call in calls]


class Chooser:
    """Drops the configurations that no chosen combination begins with, after each variation.

    So the product, which may be very large, is never made.
    """

    def __init__(
        self, entry: ConfigurationEntry, sizes: Sequence[int], rows: Sequence[Row]
    ) -> None:
        self._name = entry.name
        self._sizes = sizes
        self._rows = rows
        self._prefixes: list[Row] = [()]

    def chosen(self, configs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
        """Those of the configurations that the next variation made which are needed.

        Raises:
            InputError: the variation made another number than it had announced.
        """
        axis = len(self._prefixes[0])
        values = range(self._sizes[axis])
        made = [(*prefix, value) for prefix, value in product(self._prefixes, values)]
        if len(made) != len(configs):
            raise InputError(
                f"configuration `{self._name}`: variation {axis + 1} made {len(configs)} "
                f"configurations where its `levels` announced {len(made)}; a design needs as many."
            )
        wanted = {row[: axis + 1] for row in self._rows}
        kept = [pair for pair in zip(made, configs, strict=True) if pair[0] in wanted]
        self._prefixes = [prefix for prefix, _ in kept]
        return [config for _, config in kept]
