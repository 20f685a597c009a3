"""`optuna`: samplers that look for the best set (TPE, CMA-ES), or draw at random.

A study is made anew for each batch, from all that is stored, and its sampler gets a seed of its
own: what it proposes depends on seed and history alone. The state of CMA-ES follows from the sets
of its generations, so that it is computed by the package `cmaes` that Optuna builds on, and not by
Optuna's sampler, which keeps it in a storage.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from random import Random
from typing import Annotated, Any, Literal

import numpy as np
import optuna
from cmaes import CMA
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import FrozenTrial, Trial, TrialState, create_trial
from pydantic import ConfigDict, Field

from robovast.model.document.search.section import Search, SearchDimension
from robovast.model.document.search.space import at, parts, place
from robovast.model.strict_numbers import StrictNumbers
from robovast.search.strategies.random_sampling import draw_new
from robovast.search.strategy import HistoryStrategy
from robovast.search.types import Evaluation, ParamSet, SearchReport

_TRIES = 20
"""How often a set is asked for until it is one that was never proposed."""
_REMEMBERED = 4000
"""Most sets that a study is made of: the best half and the last ones."""
_STEP = 1 / 6
"""First step of CMA-ES, as a share of each dimension."""


class OptunaParameters(StrictNumbers):
    """`strategy_parameters` of `optuna`."""

    model_config = ConfigDict(extra="forbid")

    sampler: Literal["tpe", "cmaes", "random"] = "tpe"
    constant_liar: bool = True
    """TPE: keep away from sets that have no result yet."""
    n_startup_trials: Annotated[int, Field(ge=1)] | None = None
    """TPE: sets that are drawn at random before the model decides; Optuna's default when
    omitted."""


class OptunaStrategy(HistoryStrategy):
    """Proposes what a sampler of Optuna suggests."""

    PARAMS_MODEL = OptunaParameters
    METRICS = HistoryStrategy.METRICS | {"n_trials", "best_value"}
    params: OptunaParameters

    def __init__(self, cfg: Search, params: OptunaParameters) -> None:
        super().__init__(cfg, params)
        if params.sampler == "cmaes" and len(self.objectives) > 1:
            raise ValueError("`cmaes` optimizes one objective, not several; `tpe` does")
        self.told: list[Evaluation] = []
        self._distributions = {name: _distribution(d) for name, d in self.search_space.items()}

    def tell(self, evaluations: list[Evaluation]) -> None:
        """Remember evaluations, repeated ones, too: they complete a generation."""
        super().tell(evaluations)
        self.told += evaluations

    def propose(self, n: int) -> list[ParamSet]:
        """Ask the sampler."""
        seed = int(np.random.default_rng([self.seed, self.batch]).integers(2**31))
        if self.params.sampler == "cmaes":
            optimizer = self._evolved()
            optimizer.reseed_rng(seed)
            return [self.set_at(optimizer.ask()) for _ in range(n)]
        study = self._study(self._sampler(seed))
        found = {params.id: params for _ in range(n) for params in self._new(study)}
        missing = n - len(found)
        rest = draw_new(self.search_space, Random(seed), missing, self.asked | found)  # noqa: S311
        return [*found.values(), *rest]

    @property
    def asks_ahead(self) -> bool:
        """Not with CMA-ES: a generation is made from the one before."""
        return self.params.sampler != "cmaes"

    def report(self) -> SearchReport:
        """All evaluations, and the best value."""
        report = super().report()
        report.extra["n_trials"] = len(self.told)
        if report.best is not None:
            name = self.single_objective.name
            report.extra["best_value"] = report.best.objectives[name]
            report.extra["best_params"] = report.best.params.values
        return report

    def _sampler(self, seed: int) -> optuna.samplers.BaseSampler:
        if self.params.sampler == "random":
            return optuna.samplers.RandomSampler(seed=seed)
        given: dict[str, Any] = {"seed": seed, "constant_liar": self.params.constant_liar}
        if self.params.n_startup_trials is not None:
            given["n_startup_trials"] = self.params.n_startup_trials
        return optuna.samplers.TPESampler(**given)

    def _study(self, sampler: optuna.samplers.BaseSampler) -> optuna.Study:
        """A study of all sets that were proposed; those without a result count as running."""
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        study = optuna.create_study(
            sampler=sampler, directions=[objective.direction for objective in self.objectives]
        )
        study.add_trials([self._trial(params) for params in self._remembered()])
        return study

    def _remembered(self) -> list[ParamSet]:
        """The sets that the study is made of, in the order of their proposal: not too many."""
        if len(self.asked) <= _REMEMBERED:
            return list(self.asked.values())
        best = {ev.params.id for ev in super().report().evaluations[: _REMEMBERED // 2]}
        others = [id_ for id_ in self.asked if id_ not in best]
        chosen = best.union(others[len(best) - _REMEMBERED :])
        return [params for id_, params in self.asked.items() if id_ in chosen]

    def _trial(self, params: ParamSet) -> FrozenTrial:
        evaluation = self.known.get(params.id)
        values = [evaluation.objectives[o.name] for o in self.objectives] if evaluation else None
        suggested = {
            name: _suggestion(dim, params.values[name]) for name, dim in self.search_space.items()
        }
        state = TrialState.COMPLETE if evaluation else TrialState.RUNNING
        return create_trial(
            state=state, values=values, params=suggested, distributions=self._distributions
        )

    def _new(self, study: optuna.Study) -> Iterator[ParamSet]:
        """A set that was never proposed, unless the sampler insists on others."""
        for _ in range(_TRIES):
            trial = study.ask(self._distributions)
            params = self._set(trial)
            if params.id not in self.asked:
                yield params
                return
            evaluation = self.known.get(params.id)
            if evaluation is not None:
                study.tell(trial, [evaluation.objectives[o.name] for o in self.objectives])

    def _set(self, trial: Trial) -> ParamSet:
        return ParamSet(
            {name: _value(dim, trial.params[name]) for name, dim in self.search_space.items()}
        )

    def _evolved(self) -> CMA:
        """CMA-ES after all generations that are complete."""
        dimensions = len(self.search_space)
        population = _population(dimensions, self.cfg.per_batch)
        generator = np.random.default_rng([self.seed])
        optimizer = _fresh(np.full(dimensions, 0.5), population)
        solutions = [(np.array(self.place(e.params)), -self.objective_value(e)) for e in self.told]
        for start in range(0, len(solutions) - population + 1, population):
            optimizer.tell(solutions[start : start + population])
            if optimizer.should_stop():
                optimizer = _fresh(generator.random(dimensions), population)
        return optimizer


def _population(dimensions: int, per_batch: int) -> int:
    """Sets of a generation: the least number of whole batches that is enough for CMA-ES."""
    enough = 4 + math.floor(3 * math.log(dimensions))
    return per_batch * math.ceil(enough / per_batch)


def _fresh(mean: np.ndarray[Any, Any], population: int) -> CMA:
    bounds = np.tile([0.0, 1.0], (len(mean), 1))
    return CMA(mean, _STEP, bounds=bounds, population_size=population)


def _distribution(dimension: SearchDimension) -> BaseDistribution:
    """Values by their position where they are counted, else by their place in [0, 1]."""
    count = parts(dimension)
    if count is None:
        return FloatDistribution(0.0, 1.0)
    kind: Callable[[int], BaseDistribution] = (
        (lambda n: IntDistribution(0, n - 1))
        if dimension.type == "int"
        else (lambda n: CategoricalDistribution(range(n)))
    )
    return kind(count)


def _suggestion(dimension: SearchDimension, value: Any) -> float:
    """What a distribution gives for a value."""
    count = parts(dimension)
    spot = place(dimension, value)
    return spot if count is None else int(spot * count)


def _value(dimension: SearchDimension, suggestion: float) -> Any:
    count = parts(dimension)
    return at(dimension, suggestion if count is None else (suggestion + 0.5) / count)
