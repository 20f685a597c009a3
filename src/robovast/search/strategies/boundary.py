"""`boundary`: a map of where it fails, from sets near the border between failing and passing.

Sets are chosen where a Gaussian process on the failure rate is least sure on which side of `level`
they are ("straddle": Bryan et al., Active learning for identifying function threshold boundaries,
2005), one after the other as if those before had been run, so that a batch spreads out. Known sets
compete with new ones: where noise hides the border, more runs of a set help more.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from scipy.special import expit, logit
from scipy.stats import qmc

from robovast.model.document.search.section import Search
from robovast.model.document.search.space import choices
from robovast.model.strict_numbers import StrictNumbers
from robovast.search.strategies.failure_map import FailureMap
from robovast.search.strategies.failure_process import Array, FailureProcess, Observed
from robovast.search.strategy import HistoryStrategy
from robovast.search.types import Evaluation, ParamSet, SearchReport

_CANDIDATES = 1024
"""Points of the space that a batch is chosen from."""
_NEAR = 256
"""Candidates between failing and passing sets."""
_KNOWN = 256
"""Known sets that may be run more often."""
_CONFIDENCE = 1.96


class BoundaryParameters(StrictNumbers):
    """`strategy_parameters` of `boundary`."""

    model_config = ConfigDict(extra="forbid")

    level: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """The failure rate that separates failing from passing."""
    initial: Annotated[int, Field(ge=1)] | None = None
    """Sets that fill the space evenly before the map decides; twice the dimensions and two more
    when omitted."""


class BoundaryStrategy(HistoryStrategy):
    """Proposes sets where a failure map is least sure."""

    PARAMS_MODEL = BoundaryParameters
    SINGLE_OBJECTIVE = True
    METRICS = HistoryStrategy.METRICS | {"failing", "failing_low", "failing_high", "misjudged"}
    params: BoundaryParameters

    def __init__(self, cfg: Search, params: BoundaryParameters) -> None:
        super().__init__(cfg, params)
        self.initial = params.initial or 2 * len(cfg.search_space) + 2

    def tell(self, evaluations: list[Evaluation]) -> None:
        """Remember failure rates.

        Raises:
            ValueError: the objective is no rate.
        """
        name = self.single_objective.name
        for evaluation in evaluations:
            if not 0.0 <= evaluation.objectives[name] <= 1.0:
                raise ValueError(
                    f"`{name}` is {evaluation.objectives[name]}, and `boundary` needs a rate "
                    "between 0 and 1: name `failure_rate` in `objectives`, or a metric that is one"
                )
        super().tell(evaluations)
        self.__dict__.pop("process", None)

    def propose(self, n: int) -> list[ParamSet]:
        """Fill the space first, then choose what the map is least sure of."""
        begun = min(n, max(0, self.initial - len(self.asked)))
        found = self._new(self._sobol(len(self.asked), begun)) if begun else []
        if len(found) < n and self.process is not None:
            found += self._uncertain(n - len(found), self.process)
        elif len(found) < n:
            found += self._new(self._sobol(len(self.asked) + len(found), n - len(found)))
        return found

    @property
    def fills(self) -> bool:
        """As long as the map decides on no set of the next batch."""
        return len(self.asked) + self.cfg.per_batch <= self.initial

    @cached_property
    def process(self) -> FailureProcess | None:
        """The map after all evaluations; None before there are any."""
        if not self.known:
            return None
        name = self.single_objective.name
        known = list(self.known.values())
        trials = np.array([float(ev.n_samples) for ev in known])
        rates = np.array([ev.objectives[name] for ev in known])
        places = np.array([self.place(ev.params) for ev in known])
        return FailureProcess.fit(Observed(places, rates * trials, trials), self.categorical)

    @property
    def categorical(self) -> NDArray[np.bool_]:
        """Which dimensions have no order."""
        return np.array([choices(dim) is not None for dim in self.search_space.values()])

    def report(self) -> SearchReport:
        """All evaluations, and the numbers of the map."""
        report = super().report()
        if self.process is not None:
            report.extra |= self.map().numbers()
        return report

    def map(self) -> FailureMap:
        """The failure map.

        Raises:
            ValueError: nothing was evaluated yet.
        """
        if self.process is None:
            raise ValueError("nothing was evaluated yet")
        return FailureMap(self.search_space, self.process, self.params.level, self.seed)

    def _sobol(self, skipped: int, count: int) -> Array:
        """Points of a sequence that fills the space evenly."""
        generator = np.random.default_rng([self.seed, 0])
        sequence = qmc.Sobol(len(self.search_space), rng=generator)
        power = int(np.ceil(np.log2(skipped + count + 1)))
        return np.asarray(sequence.random_base2(power)[skipped : skipped + count])

    def _new(self, units: Array) -> list[ParamSet]:
        """The sets at these points that were never proposed."""
        made = {params.id: params for params in map(self.set_at, units)}
        return [params for id_, params in made.items() if id_ not in self.asked]

    def _uncertain(self, n: int, process: FailureProcess) -> list[ParamSet]:
        generator = np.random.default_rng([self.seed, self.batch + 1])
        candidates = [*self._new(self._units(generator)), *self._known_again(process)]
        if not candidates:
            return []
        open_ = list(self.open.values())
        places = np.array([self.place(params) for params in [*open_, *candidates]])
        chosen = _straddle(process, places, self.params.level, self._runs, n, len(open_))
        return [candidates[index - len(open_)] for index in chosen]

    def _units(self, generator: np.random.Generator) -> Array:
        """Points all over the space, and between failing and passing sets."""
        sequence = qmc.Sobol(len(self.search_space), rng=generator)
        near = list(self._between(generator))
        return np.vstack([sequence.random(_CANDIDATES), *([np.array(near)] if near else [])])

    def _between(self, generator: np.random.Generator) -> Iterator[Array]:
        name = self.single_objective.name
        known = [
            (np.array(self.place(ev.params)), ev.objectives[name]) for ev in self.known.values()
        ]
        failing = [spot for spot, rate in known if rate >= self.params.level]
        passing = [spot for spot, rate in known if rate < self.params.level]
        if not failing or not passing:
            return
        others = np.array(passing)
        for index in generator.integers(len(failing), size=_NEAR):
            one = failing[index]
            nearest = np.argsort(((others - one) ** 2).sum(axis=1), kind="stable")[:4]
            other = others[generator.choice(nearest)]
            yield one + generator.random() * (other - one)

    @property
    def _runs(self) -> int:
        """How often a set is run at first; runs that errored count, since others may, too."""
        counts = [ev.n_runs or ev.n_samples for ev in self.known.values()]
        return max(1, int(np.median(counts))) if counts else 1

    def _known_again(self, process: FailureProcess) -> list[ParamSet]:
        """Known sets whose runs disagree, those nearest to the border, each with more runs."""
        name = self.single_objective.name
        known = [
            ev
            for id_, ev in self.known.items()
            if 0.0 < ev.objectives[name] < 1.0 and id_ not in self.open
        ]
        if not known:
            return []
        means, _ = process.predict(np.array([self.place(ev.params) for ev in known]))
        near = np.argsort(np.abs(means - logit(self.params.level)), kind="stable")[:_KNOWN]
        return [self._with_more_runs(known[i]) for i in near]

    def _with_more_runs(self, known: Evaluation) -> ParamSet:
        """A set with further runs, beyond those that have errored."""
        return ParamSet(known.params.values, n_reps=max(known.n_samples, known.n_runs) + self._runs)


def _straddle(
    process: FailureProcess, places: Array, level: float, runs: int, count: int, given: int
) -> list[int]:
    """Indexes of the places that the process is least sure about, one after the other.

    The first `given` places are chosen already: they are executed now. Each chosen place counts as
    if its runs had come out as the process expects, so that the next ones keep away from it. Doubt
    is that of the rate, not of its logit: where all runs fail, the logit may be anything.
    """
    mean, projected = process.project(places)
    variance = process.kernel.variance() - (projected**2).sum(axis=0)
    chosen: list[int] = []
    taken = np.zeros(len(places), dtype=bool)
    columns: list[Array] = []
    for turn in range(min(given + count, len(places))):
        rate, deviation, noise = _rates(mean, variance)
        doubt = _CONFIDENCE * deviation - np.abs(rate - level)
        index = turn if turn < given else int(np.argmax(np.where(taken, -np.inf, doubt)))
        chosen.append(index)
        taken[index] = True
        cross = process.kernel(places, places[[index]])[:, 0]
        covariance = cross - projected.T @ projected[:, index]
        for column in columns:
            covariance = covariance - column * column[index]
        weight = runs * noise[index]
        shrink = weight / (1.0 + weight * max(covariance[index], 0.0))
        columns.append(covariance * np.sqrt(shrink))
        variance = variance - columns[-1] ** 2
    return chosen[given:]


_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


def _rates(mean: Array, variance: Array) -> tuple[Array, Array, Array]:
    """Expected rate, its standard deviation, and the expected noise of one run."""
    spread = np.sqrt(np.maximum(variance, 0.0))
    rates = expit(mean[:, None] + spread[:, None] * _NODES)
    weights = _WEIGHTS / _WEIGHTS.sum()
    rate = rates @ weights
    deviation = np.sqrt(np.maximum(rates**2 @ weights - rate**2, 0.0))
    return rate, deviation, (rates * (1.0 - rates)) @ weights
