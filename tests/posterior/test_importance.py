"""Importance sampling: weighted draws represent the posterior, or are reported as unreliable."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from identification.posterior.density import Posterior
from identification.posterior.importance import _PILOT, largest_shape, smoothed, weighted_draws
from identification.posterior.sample import _CHUNK, sample
from identification.work import metered, operations
from tests.posterior.test_sample import WHITE, servo_fit

Array = NDArray[np.float64]


def log_weights(deviation: float, count: int, seed: int) -> Array:
    """Log weights of draws from N(0, deviation^2) for the target N(0, 1)."""
    draws = deviation * np.random.default_rng(seed).standard_normal(count)
    found = stats.norm.logpdf(draws) - stats.norm.logpdf(draws, scale=deviation)
    return np.asarray(found)


@pytest.mark.parametrize("variance", [0.2, 0.5, 0.8])
def test_the_shape_of_the_weights_is_that_of_two_normal_laws(variance: float) -> None:
    """With proposal variance s^2 < 1, P(w > t) ~ t^(-1/k) with k = 1 - s^2.

    An additional logarithmic factor changes the estimate by about 0.1.
    """
    found = [smoothed(log_weights(np.sqrt(variance), 20_000, seed))[1] for seed in range(8)]

    assert np.mean(found) == pytest.approx(1.0 - variance, abs=0.15)


def test_a_proposal_wider_than_the_posterior_is_reliable_and_gives_its_moments() -> None:
    """The weights are bounded; mean 0 and variance 1 within four standard errors of 4096 draws."""
    rng = np.random.default_rng(5)
    draws = 1.5 * rng.standard_normal(4096)
    weights, shape = smoothed(stats.norm.logpdf(draws) - stats.norm.logpdf(draws, scale=1.5))

    assert shape < largest_shape(4096)
    assert weights.sum() == pytest.approx(1.0)
    assert abs(np.sum(weights * draws)) < 4.0 / np.sqrt(4096)
    assert np.sum(weights * draws**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 4096))


def test_a_proposal_that_hardly_meets_the_posterior_is_not_reliable() -> None:
    """A tenth of the variance gives k = 0.9, above any limit."""
    assert smoothed(log_weights(np.sqrt(0.1), 4096, 3))[1] > largest_shape(4096)
    assert smoothed(np.full(100, -np.inf))[1] == np.inf


def test_equal_weights_stay_equal() -> None:
    """A proposal equal to the posterior has equal weights."""
    weights, shape = smoothed(np.zeros(1000))

    assert np.all(weights == 1e-3)
    assert shape <= 0.0


def test_weighted_draws_of_a_motor_are_those_of_its_covariance() -> None:
    """The posterior of a linear motor with 3,000 samples is normal to a few per cent.

    The standard error of the mean is 1/sqrt(2000) sd, slightly more because draws repeat.
    """
    posterior = Posterior(servo_fit(), WHITE)

    found = weighted_draws(posterior, seed=1, count=2000)

    assert found.is_reliable
    spread = np.sqrt(np.diag(posterior.covariance()))
    off = (found.points.mean(axis=0) - posterior.centre) / spread
    assert np.abs(off).max() < 0.15
    np.testing.assert_allclose(found.points.std(axis=0), spread, rtol=0.15)


def test_a_posterior_too_expensive_for_a_chain_is_sampled_by_weights() -> None:
    """The budget allows 79 steps of 32 walkers: too few for a chain, enough for 2,500 draws."""
    posterior = Posterior(servo_fit(), WHITE)
    work = 79.5 * posterior.work(32)

    with metered():
        found = sample(posterior, seed=2, work=work)
        spent = operations()

    assert found.source == "importance"
    assert found.convergence.steps <= 20
    assert not found.convergence.reached
    assert spent < 1.5 * work


class FarTooNarrow(Posterior):
    """A posterior whose normal approximation is a thousand times narrower than it is."""

    def covariance(self) -> Array:
        """(n_dim, n_dim)."""
        return 1e-6 * super().covariance()


def test_draws_from_a_far_too_narrow_proposal_end_after_the_pilot() -> None:
    """The weights rise with the radius r as r^(5 + n) and P(r) falls as r^-5: k = 1 + n/5.

    In 9 dimensions k is 2.8, and more draws would not help.
    """
    found = weighted_draws(FarTooNarrow(servo_fit(), WHITE), seed=1, count=100)

    assert not found.is_reliable
    assert found.draws == _PILOT


def test_a_chain_that_would_need_many_times_its_budget_ends_early() -> None:
    """Walkers that start a thousand times too close together need hundreds of steps.

    The budget allows 200 steps; half of those before the end are burn-in.
    """
    posterior = FarTooNarrow(servo_fit(), WHITE)

    found = sample(posterior, seed=2, work=200.5 * posterior.work(32))

    assert found.source == "normal"
    assert found.convergence.steps <= 0.5 * 60


class FarTooWide(Posterior):
    """A posterior whose normal approximation is five times wider than it is."""

    def covariance(self) -> Array:
        """(n_dim, n_dim)."""
        return 25.0 * super().covariance()


def test_walkers_that_stay_in_place_end_the_chain_after_twenty_steps() -> None:
    """In 9 dimensions a proposal five times too wide is accepted a few times in a thousand.

    The budget allows 200 steps, and the autocorrelation time of 20 steps says nothing yet.  Normal
    draws replace the chain, and their posterior density is not evaluated.
    """
    posterior = FarTooWide(servo_fit(), WHITE)

    found = sample(posterior, seed=2, work=200.5 * posterior.work(32))

    assert found.convergence.steps <= 20
    assert found.source == "normal"
    assert found.log_density is None


def test_a_chain_that_ends_too_early_is_replaced_by_weighted_draws() -> None:
    """Ten steps are too short for a chain, while the importance weights are reliable."""
    found = sample(Posterior(servo_fit(), WHITE), seed=2, most_steps=_CHUNK)

    assert not found.convergence.reached
    assert found.source == "importance"
    assert found.shape is not None
    assert found.shape < 0.7
    assert found.chain.shape[0] * found.chain.shape[1] >= 1900
