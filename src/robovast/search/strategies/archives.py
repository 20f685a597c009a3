"""Archives of quality diversity: cells in the space of measures, which keep the best set each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, FiniteFloat, model_validator
from pydantic_core import PydanticCustomError
from scipy.spatial import KDTree
from scipy.stats import qmc

from robovast.model.strict_numbers import StrictNumbers

_SAMPLES = 20
"""Points for each cell that its centre is the mean of."""
_ROUNDS = 8
"""How often the centres move to the mean of their points."""


class Measure(StrictNumbers):
    """An axis of an archive."""

    model_config = ConfigDict(extra="forbid")

    low: FiniteFloat
    """Values below belong to the first cells."""
    high: FiniteFloat
    """Values above belong to the last cells."""
    bins: Annotated[int, Field(ge=1, le=10_000)] = 20
    """`grid`: number of parts."""

    @model_validator(mode="after")
    def _has_length(self) -> Measure:
        if self.low >= self.high:
            raise PydanticCustomError("measure", "needs `low` below `high`")
        return self


class ArchiveParameters(StrictNumbers):
    """`archive` of `qd`."""

    model_config = ConfigDict(extra="forbid")

    type: Literal["grid", "cvt"] = "grid"
    """Equal parts of each measure, or cells around centres that are evenly spread."""
    cells: Annotated[int, Field(ge=1, le=100_000)] = 512
    """`cvt`: number of cells."""
    measures: Annotated[dict[str, Measure], Field(min_length=1)]
    """The axes: measures that the extractor gives."""


class Cells(ABC):
    """The cells of an archive, by number."""

    def __init__(self, measures: Mapping[str, Measure]) -> None:
        self.measures = measures

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of cells."""

    @abstractmethod
    def _at(self, spot: NDArray[np.float64]) -> int:
        """The cell at a place of the unit cube of measures."""

    def of(self, given: Mapping[str, float]) -> int:
        """The cell of measured values; those beyond the ends belong to the outermost ones."""
        return self._at(self.place(given))

    def place(self, given: Mapping[str, float]) -> NDArray[np.float64]:
        """The place of measured values in the unit cube."""
        spot = [(given[name] - m.low) / (m.high - m.low) for name, m in self.measures.items()]
        return np.clip(spot, 0.0, 1.0)


class Grid(Cells):
    """Equal parts of each measure."""

    @property
    def count(self) -> int:
        """Product of the parts."""
        return int(np.prod([float(n) for n in self._shape]))

    @property
    def _shape(self) -> list[int]:
        return [measure.bins for measure in self.measures.values()]

    def _at(self, spot: NDArray[np.float64]) -> int:
        cell = 0
        for unit, bins in zip(spot, self._shape, strict=True):
            cell = cell * bins + min(int(unit * bins), bins - 1)
        return cell


class Voronoi(Cells):
    """Cells around centres that are evenly spread (a centroidal Voronoi tessellation)."""

    def __init__(self, measures: Mapping[str, Measure], cells: int, seed: int) -> None:
        super().__init__(measures)
        self._cells = cells
        self._seed = seed

    @property
    def count(self) -> int:
        """Number of centres."""
        return self._cells

    @cached_property
    def _tree(self) -> KDTree:
        """The centres: Lloyd's algorithm, from a sequence that is spread evenly already."""
        sequence = qmc.Sobol(len(self.measures), rng=np.random.default_rng([self._seed, 3]))
        points = sequence.random_base2(int(np.ceil(np.log2(_SAMPLES * self._cells))))
        centres = points[: self._cells]
        for _ in range(_ROUNDS):
            nearest = KDTree(centres).query(points)[1]
            weight = np.bincount(nearest, minlength=self._cells)
            sums = [np.bincount(nearest, c, minlength=self._cells) for c in points.T]
            moved = np.array(sums).T / np.maximum(weight, 1)[:, None]
            centres = np.where(weight[:, None] > 0, moved, centres)
        return KDTree(centres)

    def _at(self, spot: NDArray[np.float64]) -> int:
        return int(self._tree.query(spot)[1])


def cells_of(parameters: ArchiveParameters, seed: int) -> Cells:
    """The cells that a document asks for."""
    if parameters.type == "grid":
        return Grid(parameters.measures)
    return Voronoi(parameters.measures, parameters.cells, seed)


def mirrored(units: Sequence[float] | NDArray[Any]) -> NDArray[np.float64]:
    """Places beyond the ends of the unit cube, thrown back into it."""
    folded = np.mod(np.asarray(units), 2.0)
    return np.asarray(np.where(folded > 1.0, 2.0 - folded, folded))
