"""A Gaussian process on the rate of failures, with binomial noise.

The latent value is the logit of the failure rate; its posterior is Laplace's approximation
(Rasmussen and Williams, Gaussian Processes for Machine Learning, algorithms 3.1, 3.2 and 5.1), so
that two runs weigh less than twenty. The kernel is a Matérn 5/2 with a length for each dimension;
two different choices are one unit apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from scipy.special import expit

Array = NDArray[np.float64]

FITTED = 200
"""Most sets that the kernel's parameters are fitted to."""
ACTIVE = 800
"""Most sets that the posterior is computed from."""
_CONSTANT = 4.0
"""Prior variance of the mean logit."""
_PRIOR_SPREAD = 1.0
"""Prior standard deviation of the logarithms of all parameters."""


@dataclass(frozen=True)
class Kernel:
    """Covariance of logits."""

    amplitude: float
    lengths: Array
    categorical: NDArray[np.bool_]

    def __call__(self, one: Array, other: Array) -> Array:
        """Covariance of all pairs."""
        unit = np.where(self.categorical, 0.0, 1.0 / self.lengths)
        scaled = cdist(one * unit, other * unit, "sqeuclidean")
        for column in np.flatnonzero(self.categorical).tolist():
            scaled += _apart(one, other, column, self.categorical) / self.lengths[column] ** 2
        return self._covariance(scaled)

    def variance(self) -> float:
        """Prior variance of any point."""
        return self.amplitude**2 + _CONSTANT

    def _covariance(self, scaled: Array) -> Array:
        root = np.sqrt(5.0 * scaled)
        matern = (1.0 + root + root**2 / 3.0) * np.exp(-root)
        return np.asarray(self.amplitude**2 * matern + _CONSTANT)

    def with_gradients(self, apart: Array) -> tuple[Array, list[Array]]:
        """Covariance, and its derivatives by the logarithms of amplitude and lengths.

        Args:
            apart: squared distances of all pairs, by dimension.
        """
        scaled = apart / (self.lengths**2)[:, None, None]
        total = scaled.sum(axis=0)
        root = np.sqrt(5.0 * total)
        decay = np.exp(-root)
        slope = self.amplitude**2 * 5.0 / 3.0 * (1.0 + root) * decay
        covariance = self._covariance(total)
        return covariance, [2.0 * (covariance - _CONSTANT), *(slope * part for part in scaled)]


def _apart(one: Array, other: Array, column: int, categorical: NDArray[np.bool_]) -> Array:
    """Squared distances in one dimension."""
    difference = one[:, None, column] - other[None, :, column]
    return (difference != 0).astype(float) if categorical[column] else difference**2


@dataclass(frozen=True)
class Observed:
    """Failures among the trials of each place."""

    places: Array
    failures: Array
    trials: Array

    def __len__(self) -> int:
        return len(self.places)

    def part(self, chosen: NDArray[np.int64]) -> Observed:
        """Some of the places."""
        return Observed(self.places[chosen], self.failures[chosen], self.trials[chosen])


@dataclass(frozen=True)
class _Mode:
    """Laplace's approximation: the most likely logits, and the curvature there."""

    logits: Array
    weights: Array
    slope: Array
    """Derivative of the likelihood; also the covariance's inverse times the logits."""
    root: Array
    """Cholesky factor of I + W½ K W½."""
    evidence: float

    @classmethod
    def find(cls, covariance: Array, seen: Observed) -> _Mode:
        """Newton's method, with halved steps where it overshoots."""
        logits = np.zeros(len(seen))
        value, alpha = -np.inf, np.zeros(len(seen))
        for _ in range(50):
            rate = expit(logits)
            weights = np.maximum(seen.trials * rate * (1.0 - rate), 1e-10)
            gain = np.sqrt(weights)
            root = cholesky(_inner(covariance, gain), lower=True, check_finite=False)
            target = weights * logits + seen.failures - seen.trials * rate
            step = gain * cho_solve((root, True), gain * (covariance @ target), check_finite=False)
            alpha, logits, new = _ascend(covariance, seen, alpha, target - step, value)
            done, value = new - value < 1e-5, max(new, value)
            if done:
                break
        rate = expit(logits)
        weights = np.maximum(seen.trials * rate * (1.0 - rate), 1e-10)
        root = cholesky(_inner(covariance, np.sqrt(weights)), lower=True, check_finite=False)
        evidence = value - float(np.log(np.diag(root)).sum())
        return cls(logits, weights, seen.failures - seen.trials * rate, root, evidence)


def _inner(covariance: Array, gain: Array) -> Array:
    matrix = covariance * gain[:, None] * gain[None, :]
    matrix[np.diag_indices_from(matrix)] += 1.0
    return matrix


def _ascend(
    covariance: Array, seen: Observed, start: Array, end: Array, before: float
) -> tuple[Array, Array, float]:
    """The first point on the way from the end back to the start that is better than before."""
    for share in (1.0, 0.5, 0.25, 0.125, 0.0):
        alpha = start + share * (end - start)
        logits = covariance @ alpha
        value = float(
            -0.5 * alpha @ logits + seen.failures @ logits - seen.trials @ np.logaddexp(0.0, logits)
        )
        if value >= before:
            break
    return alpha, logits, value


@dataclass(frozen=True)
class FailureProcess:
    """The posterior of the failure rate's logit."""

    kernel: Kernel
    seen: Observed

    @classmethod
    def fit(cls, seen: Observed, categorical: NDArray[np.bool_]) -> FailureProcess:
        """The process that explains what was observed best; its cost is bounded."""
        small = seen.part(_spread(len(seen), FITTED))
        kernel = _fitted(small, categorical)
        if len(seen) <= ACTIVE:
            return cls(kernel, seen)
        means, _ = cls(kernel, small).predict(seen.places)
        near = np.argsort(np.abs(means), kind="stable")
        half = ACTIVE // 2
        rest = near[half:][_spread(len(near) - half, ACTIVE - half)]
        return cls(kernel, seen.part(np.sort(np.concatenate([near[:half], rest]))))

    @cached_property
    def _mode(self) -> _Mode:
        return _Mode.find(self.kernel(self.seen.places, self.seen.places), self.seen)

    def predict(self, places: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of the logit."""
        mean, projected = self.project(places)
        variance = self.kernel.variance() - (projected**2).sum(axis=0)
        return mean, np.sqrt(np.maximum(variance, 1e-12))

    def project(self, places: Array) -> tuple[Array, Array]:
        """Mean of the logit, and the columns whose products the observations take away from the
        prior covariance."""
        cross = self.kernel(self.seen.places, places)
        gain = np.sqrt(self._mode.weights)
        projected = solve_triangular(
            self._mode.root, gain[:, None] * cross, lower=True, check_finite=False
        )
        return self._mode.slope @ cross, projected

    def sample(self, places: Array, count: int, generator: np.random.Generator) -> Array:
        """Samples of the logit, one a row."""
        mean, projected = self.project(places)
        covariance = self.kernel(places, places) - projected.T @ projected
        values, vectors = np.linalg.eigh(covariance)
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = generator.standard_normal((count, len(places)))
        return np.asarray(mean + drawn @ factor.T)


def _spread(total: int, most: int) -> NDArray[np.int64]:
    """At most so many indexes, evenly spread."""
    if total <= most:
        return np.arange(total)
    return np.unique(np.linspace(0, total - 1, most).astype(np.int64))


def _fitted(seen: Observed, categorical: NDArray[np.bool_]) -> Kernel:
    """The most likely kernel under the prior of its parameters."""
    dimensions = seen.places.shape[1]
    columns = range(dimensions)
    apart = np.stack([_apart(seen.places, seen.places, c, categorical) for c in columns])
    prior = np.log([3.0, *[0.5 * np.sqrt(dimensions)] * dimensions])

    def loss(theta: Array) -> tuple[float, Array]:
        kernel = Kernel(float(np.exp(theta[0])), np.exp(theta[1:]), categorical)
        evidence, gradient = _evidence(*kernel.with_gradients(apart), seen)
        off = (theta - prior) / _PRIOR_SPREAD
        return float(0.5 * off @ off - evidence), off / _PRIOR_SPREAD - gradient

    bounds = [(p - 3.0, p + 3.0) for p in prior]
    found: Any = minimize(
        loss, prior, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 15}
    )
    return Kernel(float(np.exp(found.x[0])), np.exp(found.x[1:]), categorical)


def _evidence(covariance: Array, slopes: list[Array], seen: Observed) -> tuple[float, Array]:
    """Logarithm of the evidence, and its derivatives by the kernel's parameters."""
    mode = _Mode.find(covariance, seen)
    gain = np.sqrt(mode.weights)
    inverse = cho_solve((mode.root, True), np.diag(gain), check_finite=False) * gain[:, None]
    columns = solve_triangular(
        mode.root, gain[:, None] * covariance, lower=True, check_finite=False
    )
    rate = expit(mode.logits)
    third = -seen.trials * rate * (1.0 - rate) * (1.0 - 2.0 * rate)
    variance = np.diag(covariance) - (columns**2).sum(axis=0)
    bend = 0.5 * variance * third
    gradient = []
    for slope in slopes:
        explicit = 0.5 * mode.slope @ slope @ mode.slope - 0.5 * np.sum(inverse * slope)
        moved = slope @ mode.slope
        moved = moved - covariance @ (inverse @ moved)
        gradient.append(float(explicit + bend @ moved))
    return mode.evidence, np.array(gradient)
