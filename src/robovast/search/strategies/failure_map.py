"""What a failure process says about the whole space: how much fails, and where it begins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.special import expit, logit, ndtr
from scipy.stats import qmc

from robovast.model.document.search.section import SearchDimension
from robovast.model.document.search.space import Space, at, choices, parts, place
from robovast.search.strategies.failure_process import Array, FailureProcess

_POINTS = 512
"""Points that the whole space is judged by."""
_SAMPLES = 400
"""Samples of the process that intervals are made from."""
_LINE = 101
"""Points of a line along one dimension."""
_PLACES = np.linspace(0.0, 1.0, _LINE)
_INTERVAL = (0.025, 0.975)
_OPEN: dict[tuple[bool, bool], Literal["low", "high", "both"] | None] = {
    (False, False): None,
    (True, False): "low",
    (False, True): "high",
    (True, True): "both",
}
"""How an interval is open, by whether its ends are those of the space."""
_SIDE = 61
"""Points of a side of a surface, of a dimension that is not counted."""


@dataclass(frozen=True)
class Critical:
    """Where the failure rate crosses the level as one parameter grows."""

    name: str
    value: float | None
    """Where it crosses; None if the map nowhere does, though it may with the probability below."""
    low: float | None
    """The ends of the 95 % interval."""
    high: float | None
    above: str | None
    """What is to be expected above that value: it "fails", or it "passes"."""
    crossing: float
    """Probability that it crosses the level anywhere, the other parameters being fixed."""
    open: Literal["low", "high", "both"] | None = None
    """The ends of the interval that are ends of the space: the value may lie beyond them."""


@dataclass(frozen=True)
class Surface:
    """A failure map over two dimensions; a row for each place down, a column for each across."""

    across: Array
    """Places in the unit interval."""
    down: Array
    rate: Array
    low: Array
    """The ends of the 95 % interval."""
    high: Array


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

    def over(self, across: str, down: str, base: Sequence[float]) -> Surface:
        """The map over two dimensions.

        Args:
            across: one of them.
            down: the other one.
            base: a point of the unit cube, which says where all others are.
        """
        axes = [_units(self.space[name]) for name in (across, down)]
        spots = np.tile(np.asarray(base, dtype=float), (len(axes[0]) * len(axes[1]), 1))
        for name, values in zip((across, down), np.meshgrid(*axes), strict=True):
            spots[:, list(self.space).index(name)] = values.ravel()
        shape = (len(axes[1]), len(axes[0]))
        rate, low, high = (part.reshape(shape) for part in self.probability(spots))
        return Surface(axes[0], axes[1], rate, low, high)

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

    def critical(self, base: Sequence[float]) -> list[Critical]:
        """The critical values of each number, the others being fixed; one without any, if none.

        Args:
            base: a point of the unit cube, which says where they are.
        """
        return [
            found
            for column, (name, dim) in enumerate(self.space.items())
            if choices(dim) is None and dim.low != dim.high
            for found in self._along(column, name, base)
        ]

    def _along(self, column: int, name: str, base: Sequence[float]) -> list[Critical]:
        units = np.tile(base, (_LINE, 1))
        units[:, column] = _PLACES
        generator = np.random.default_rng([self.seed, column])
        samples = self.process.sample(units, _SAMPLES, generator) - self._border
        share = float(np.mean([len(_crossings(_PLACES, row)) > 0 for row in samples]))
        mean, _ = self.process.predict(units)
        spots = _crossings(_PLACES, mean - self._border)
        if not len(spots):
            return [Critical(name, None, None, None, None, share)]
        fails_first = bool(mean[0] > self._border)
        return [
            self._critical(name, float(spot), samples, share, (number % 2 == 1) == fails_first)
            for number, spot in enumerate(spots)
        ]

    def _critical(
        self, name: str, middle: float, samples: Array, share: float, fails: bool
    ) -> Critical:
        """One crossing, above which it fails or passes; its interval is that of the nearest such
        crossing of each sample. Where a sample has none, it is beyond an end of the space."""
        rising = samples if fails else -samples
        found = [spots[np.argmin(np.abs(spots - middle))] for spots in map(_rises, rising)]
        low, high = np.quantile(found, _INTERVAL)
        ends = (middle, min(low, middle), max(high, middle))
        value, least, most = (float(at(self.space[name], spot)) for spot in ends)
        open_ = _OPEN[bool(low <= 0.0), bool(high >= 1.0)]
        return Critical(name, value, least, most, "fails" if fails else "passes", share, open_)

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


def _rises(values: Array) -> Array:
    """Where values along a line become positive; at its end if they are not within, at its begin
    if they are before."""
    padded = np.concatenate([[-1.0], values, [1.0]])
    return _crossings(np.concatenate([[0.0], _PLACES, [1.0]]), padded)[::2]


def _units(dimension: SearchDimension) -> Array:
    """The middles of a dimension's few values, or points from one end to the other."""
    count = parts(dimension)
    if count is None or count > _SIDE:
        return np.linspace(0.0, 1.0, _SIDE)
    return np.asarray((np.arange(count) + 0.5) / count)
