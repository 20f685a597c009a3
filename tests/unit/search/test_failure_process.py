"""The posterior of failure rates is that of scikit-learn's Gaussian process classifier."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.optional import needs

needs("sklearn")

from sklearn.gaussian_process import GaussianProcessClassifier  # noqa: E402
from sklearn.gaussian_process.kernels import ConstantKernel, Matern  # noqa: E402

from robovast.search.strategies.failure_process import (  # noqa: E402
    FailureProcess,
    Kernel,
    Observed,
)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 4),
    st.integers(4, 30),
    st.floats(0.3, 4.0),
    st.floats(0.1, 2.0),
)
def test_counts_have_the_posterior_of_as_many_single_runs(
    seed: int, dimensions: int, sets: int, amplitude: float, length: float
) -> None:
    generator = np.random.default_rng(seed)
    places = generator.random((sets, dimensions))
    trials = generator.integers(1, 8, sets)
    failures = generator.binomial(trials, generator.random(sets))
    failures[0], failures[1] = 0, trials[1]  # the classifier needs both classes
    lengths = np.full(dimensions, length) * generator.uniform(0.5, 2.0, dimensions)
    kernel = Kernel(amplitude, lengths, np.zeros(dimensions, dtype=bool))
    ours = FailureProcess(kernel, Observed(places, failures.astype(float), trials.astype(float)))

    runs = np.repeat(places, trials, axis=0)
    failed = np.concatenate([np.arange(n) < k for n, k in zip(trials, failures, strict=True)])
    covariance = ConstantKernel(amplitude**2) * Matern(lengths, nu=2.5) + ConstantKernel(4.0)
    oracle = GaussianProcessClassifier(covariance, optimizer=None).fit(runs, failed)

    asked = generator.random((20, dimensions))
    mean, spread = ours.predict(asked)
    expected, variance = oracle.latent_mean_and_variance(asked)
    assert mean == pytest.approx(expected, abs=2e-2)
    assert spread == pytest.approx(np.sqrt(variance), abs=2e-2)
    assert ours._mode.evidence == pytest.approx(oracle.log_marginal_likelihood_value_, abs=1e-2)
