"""Diagnostics of chains with known properties."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.posterior.convergence import (
    autocorrelation_times,
    convergence_of,
    split_r_hat,
)

Array = NDArray[np.float64]


def autoregressive(steps: int, walkers: int, pole: float, seed: int) -> Array:
    """Chain (steps, walkers, 1) of stationary autoregressive walkers."""
    rng = np.random.default_rng(seed)
    chain = np.empty((steps, walkers, 1))
    chain[0] = rng.standard_normal((walkers, 1)) / np.sqrt(1 - pole**2)
    for k in range(1, steps):
        chain[k] = pole * chain[k - 1] + rng.standard_normal((walkers, 1))
    return chain


@pytest.mark.parametrize("pole", [0.5, 0.9])
def test_the_autocorrelation_time_is_that_of_the_process(pole: float) -> None:
    """Closed form for an autoregressive process of order one: (1 + pole) / (1 - pole)."""
    chain = autoregressive(4000, 32, pole, seed=1)

    found = convergence_of(chain, acceptance=0.5)

    expected = (1 + pole) / (1 - pole)
    assert found.autocorrelation_time == pytest.approx(expected, rel=0.15)
    assert found.ess_min == pytest.approx(4000 * 32 / expected, rel=0.15)
    assert found.reached
    assert (found.walkers, found.steps, found.acceptance) == (32, 4000, 0.5)


def test_walkers_that_stay_apart_have_a_time_as_long_as_the_chain() -> None:
    """With standard deviations of 3 between and 1 within walkers, the correlation stays at 9/10.

    The biased estimate decreases linearly, so its sum is 0.9 of the chain length, and the window of
    five times covers the whole chain.
    """
    rng = np.random.default_rng(7)
    chain = rng.standard_normal((400, 200, 1)) + 3.0 * rng.standard_normal((1, 200, 1))

    assert autocorrelation_times(chain)[0] == pytest.approx(0.9 * 400, rel=0.05)


def test_a_walker_that_never_moves_leaves_a_finite_time() -> None:
    """One of 32 walkers is constant; the others have a time of 3 steps (pole 0.5)."""
    chain = autoregressive(1000, 32, 0.5, seed=8)
    chain[:, 0] = 0.0

    assert 3.0 < autocorrelation_times(chain)[0] < 6.0
    assert autocorrelation_times(np.ones((50, 8, 2))).tolist() == [50.0, 50.0]


def test_a_chain_shorter_than_required_is_reported() -> None:
    """Fifty times of 19 steps require 950 steps; the chain has 400."""
    chain = autoregressive(400, 32, 0.9, seed=2)

    assert not convergence_of(chain, acceptance=0.5).reached


def test_r_hat_of_independent_draws_is_one() -> None:
    """Halves with the same distribution have equal means, so R-hat is 1 up to chance."""
    chain = np.random.default_rng(3).standard_normal((1000, 16, 2))

    np.testing.assert_allclose(split_r_hat(chain), 1.0, atol=0.01)


def test_r_hat_of_walkers_that_stay_apart_is_large_as_a_negative_control() -> None:
    """Walkers with means 3 sd apart have R-hat = sqrt(1 + 9) in the limit."""
    rng = np.random.default_rng(4)
    chain = rng.standard_normal((2000, 400, 1)) + 3.0 * rng.standard_normal((1, 400, 1))

    assert split_r_hat(chain)[0] == pytest.approx(np.sqrt(10.0), rel=0.15)


def test_r_hat_of_a_chain_that_drifts_is_large_as_a_negative_control() -> None:
    """The walkers agree at every step, but the halves of each walker do not."""
    rng = np.random.default_rng(5)
    drift = np.linspace(-2.0, 2.0, 2000)[:, None, None]

    assert split_r_hat(rng.standard_normal((2000, 20, 1)) + drift)[0] > 1.2


def test_a_dimension_that_never_moves_does_not_divide_by_zero() -> None:
    """Without variance, R-hat is one by definition."""
    np.testing.assert_array_equal(split_r_hat(np.ones((100, 8, 1))), [1.0])
