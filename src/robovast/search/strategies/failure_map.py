"""What a failure process says about the whole space: how much fails, and where it begins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import expit, logit, ndtr
from scipy.stats import qmc

from robovast.model.document.search.space import Space, at, choices, place
from robovast.search.strategies.failure_process import Array, FailureProcess

_POINTS = 512
"""Points that the whole space is judged by."""
_SAMPLES = 400
"""Samples of the process that intervals are made from."""
_LINE = 101
"""Points of a line along one dimension."""
_INTERVAL = (0.025, 0.975)


@dataclass(frozen=True)
class Critical:
    """Where one parameter begins, or ceases, to make it fail."""

    name: str
    value: float | None
    """The first value where the rate crosses the level; None where it never does."""
    low: float | None
    """The ends of the 95 % interval."""
    high: float | None
    crossing: float
    """Probability that it crosses the level at all, the other parameters being fixed."""


@dataclass(frozen=True)
class FailureMap:
    """The probability of failure over a search space, and what follows from it."""

    space: Space
    process: FailureProcess
    level: float
    seed: int

    def probability(self, units: Array) -> tuple[Array, Array, Array]:
        """The rate of failures at points of the unit cube, and the ends of its 95 % interval."""
        mean, deviation = self.process.predict(units)
        ends = [expit(mean + sign * 1.96 * deviation) for sign in (-1.0, 1.0)]
        return expit(mean), ends[0], ends[1]

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Points all over the space: values, rate of failures, ends of its interval."""
        numbers = zip(*self.probability(self._points), strict=True)
        for unit, rates in zip(self._points, numbers, strict=True):
            values = (at(dim, spot) for dim, spot in zip(self.space.values(), unit, strict=True))
            yield (*values, *(float(rate) for rate in rates))

    def numbers(self) -> dict[str, float]:
        """The share of the space that fails, its interval, and the share that is misjudged."""
        mean, deviation = self.process.predict(self._points)
        wrong = float(np.mean(ndtr(-np.abs(mean - self._border) / deviation)))
        low, high = np.quantile(self._shares, _INTERVAL)
        return {
            "failing": float(np.mean(mean > self._border)),
            "failing_low": float(low),
            "failing_high": float(high),
            "misjudged": wrong,
        }

    def critical(self, fixed: Mapping[str, Any] | None = None) -> list[Critical]:
        """The critical value of each number, the others being fixed.

        Args:
            fixed: values of parameters; the middle of the space where they are not given.

        Raises:
            ValueError: a value is not in the space.
        """
        base = [
            place(dim, fixed[name]) if fixed and name in fixed else 0.5
            for name, dim in self.space.items()
        ]
        return [
            self._along(column, name, base)
            for column, (name, dim) in enumerate(self.space.items())
            if choices(dim) is None and dim.low != dim.high
        ]

    def _along(self, column: int, name: str, base: list[float]) -> Critical:
        line = np.linspace(0.0, 1.0, _LINE)
        units = np.tile(base, (_LINE, 1))
        units[:, column] = line
        generator = np.random.default_rng([self.seed, column])
        samples = self.process.sample(units, _SAMPLES, generator) - self._border
        crossings = [spots for row in samples if len(spots := _crossings(line, row))]
        mean, _ = self.process.predict(units)
        first = _crossings(line, mean - self._border)
        share = len(crossings) / _SAMPLES
        if not len(first) or not crossings:
            return Critical(name, None, None, None, share)
        middle = float(first[0])
        found = [ends[np.argmin(np.abs(ends - middle))] for ends in crossings]
        low, high = np.quantile(found, _INTERVAL)
        ends = (middle, min(low, middle), max(high, middle))
        value, least, most = (float(at(self.space[name], spot)) for spot in ends)
        return Critical(name, value, least, most, share)

    @property
    def _border(self) -> float:
        return float(logit(self.level))

    @cached_property
    def _points(self) -> Array:
        sequence = qmc.Sobol(len(self.space), rng=np.random.default_rng([self.seed, 1]))
        points = np.asarray(sequence.random(_POINTS))
        for column, dim in enumerate(self.space.values()):
            points[:, column] = [place(dim, at(dim, unit)) for unit in points[:, column]]
        return points

    @cached_property
    def _shares(self) -> Array:
        generator = np.random.default_rng([self.seed, 2])
        samples = self.process.sample(self._points, _SAMPLES, generator)
        return np.asarray(np.mean(samples > self._border, axis=1))


def _crossings(line: Array, values: Array) -> Array:
    """Where values change their sign."""
    index = np.flatnonzero(np.signbit(values[1:]) != np.signbit(values[:-1]))
    before, after = values[index], values[index + 1]
    return np.asarray(line[index] + (line[index + 1] - line[index]) * before / (before - after))
