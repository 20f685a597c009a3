"""`qd`: an archive of sets that differ in how they behave, the best of each kind (MAP-Elites).

Sets are made from those in the archive: moved at random, and along the line to another one
("Iso+LineDD": Vassiliades and Mouret, Discovering the elite hypervolume by leveraging
interspecies correlation, 2018), more often where the archive is sparse. It is our own, since `ribs`
brings numba, pandas and scikit-learn, and keeps states that do not follow from what is stored;
tests/bench/RESULTS.md compares both.
"""

from __future__ import annotations

from functools import cached_property
from random import Random
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from scipy.spatial import KDTree

from robovast.model.document.search.section import Search
from robovast.model.strict_numbers import StrictNumbers
from robovast.search.strategies.archives import ArchiveParameters, Cells, cells_of, mirrored
from robovast.search.strategies.random_sampling import draw_new
from robovast.search.strategy import HistoryStrategy
from robovast.search.types import Evaluation, ParamSet, SearchReport

Array = NDArray[np.float64]

_TRIES = 20
"""How often a set is moved until it is one that was never proposed."""
_NEIGHBOURS = 6
"""Sets of the archive, itself included, whose distance says how sparse it is around one."""
_LINE = 0.2
"""Step along the line to another set, as a share of its length."""


class QualityDiversityParameters(StrictNumbers):
    """`strategy_parameters` of `qd`."""

    model_config = ConfigDict(extra="forbid")

    archive: ArchiveParameters
    """The cells that are to be filled."""
    sigma: Annotated[float, Field(gt=0, le=1)] = 0.1
    """Step at random, as a share of each dimension."""
    emitters: Annotated[int, Field(ge=1, le=16)] = 1
    """Sizes of steps that take turns; each is half of the one before."""


class QualityDiversityStrategy(HistoryStrategy):
    """Fills an archive with sets that differ."""

    PARAMS_MODEL = QualityDiversityParameters
    SINGLE_OBJECTIVE = True
    METRICS = HistoryStrategy.METRICS | {"coverage", "qd_score", "num_elites"}
    params: QualityDiversityParameters

    def __init__(self, cfg: Search, params: QualityDiversityParameters) -> None:
        super().__init__(cfg, params)
        self.elites: dict[int, Evaluation] = {}
        """The best set of each cell that has one."""

    @property
    def needed_measures(self) -> frozenset[str]:
        """The archive's axes."""
        return frozenset(self.params.archive.measures)

    @cached_property
    def cells(self) -> Cells:
        """The cells of the archive."""
        return cells_of(self.params.archive, self.seed)

    def tell(self, evaluations: list[Evaluation]) -> None:
        """Remember evaluations; the archive keeps the best of each cell."""
        super().tell(evaluations)
        for evaluation in evaluations:
            cell = self.cells.of(evaluation.measures)
            best = self.elites.get(cell)
            if best is None or self.objective_value(evaluation) > self.objective_value(best):
                self.elites[cell] = evaluation

    def propose(self, n: int) -> list[ParamSet]:
        """Move sets of the archive, at first the middle of the space."""
        found: dict[str, ParamSet] = {}
        generator = np.random.default_rng([self.seed, self.batch])
        parents, weights = self._parents()
        for turn in range(n * _TRIES):
            sigma = self.params.sigma * 0.5 ** (turn % self.params.emitters)
            one = parents[generator.choice(len(parents), p=weights)]
            other = parents[generator.integers(len(parents))]
            aside = sigma * generator.standard_normal(len(one))
            along = _LINE * generator.standard_normal() * (other - one)
            moved = self.set_at(mirrored(one + aside + along))
            if moved.id not in self.asked:
                found[moved.id] = moved
            if len(found) == n:
                break
        drawn = Random(f"{self.seed}/{self.batch}")  # noqa: S311  # not for secrets
        rest = draw_new(self.search_space, drawn, n - len(found), self.asked.keys() | found.keys())
        return [*found.values(), *rest]

    def _parents(self) -> tuple[Array, Array]:
        """Places of the sets in the archive, and how often each is moved: more often where the
        archive is sparse."""
        if not self.elites:
            return np.full((1, len(self.search_space)), 0.5), np.ones(1)
        places = np.array([self.place(elite.params) for elite in self.elites.values()])
        spots = np.array([self.cells.place(elite.measures) for elite in self.elites.values()])
        near = min(_NEIGHBOURS, len(spots))
        apart = np.atleast_2d(KDTree(spots).query(spots, k=range(1, near + 1))[0])
        weights = (apart.mean(axis=1) + 1e-9) ** 2
        return places, weights / weights.sum()

    def report(self) -> SearchReport:
        """All evaluations, and how much of the archive is filled."""
        report = super().report()
        report.extra |= {
            "coverage": len(self.elites) / self.cells.count,
            "qd_score": sum(map(self.objective_value, self.elites.values())),
            "num_elites": len(self.elites),
            "elites": [
                {"params": ev.params.values, "objectives": ev.objectives, "measures": ev.measures}
                for _, ev in sorted(self.elites.items())
            ],
        }
        return report
