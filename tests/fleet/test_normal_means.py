"""Hierarchical normal model: coverage, limits, and an independent estimate of the spread."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from identification.fleet.pooling import population_of

Array = NDArray[np.float64]
GROUPS = 10


def drawn(tau: float, rng: np.random.Generator, count: int = GROUPS) -> tuple[Array, ...]:
    """True values, estimates and standard deviations of a population with mean 5."""
    sds = rng.uniform(0.5, 2.0, count)
    true = 5.0 + tau * rng.normal(size=count)
    return true, true + sds * rng.normal(size=count), sds


def test_intervals_cover_at_their_level_and_are_narrower_than_the_own_ones() -> None:
    """If tau is drawn from its prior, Bayesian 90 % intervals contain 90 % of the true values.

    300 populations of ten motors; four binomial standard deviations of 300 are 7 %.
    """
    rng = np.random.default_rng(1)
    inside, mean_inside, spread_inside, ratio = [], [], [], []
    for _ in range(300):
        tau = abs(rng.standard_t(4))
        true, values, sds = drawn(tau, rng)
        found = population_of(values, sds, 1.0)
        inside += [*((found.groups[:, 0] < true) & (true < found.groups[:, 2]))]
        mean_inside.append(found.mean[0] < 5.0 < found.mean[2])
        spread_inside.append(found.spread[0] < tau < found.spread[2])
        ratio += [*((found.groups[:, 2] - found.groups[:, 0]) / (3.29 * sds))]

    for held in (inside, mean_inside, spread_inside):
        assert np.mean(held) == pytest.approx(0.9, abs=0.07)
    assert np.mean(ratio) < 0.8


def test_wide_population_leaves_the_estimates_as_they_are() -> None:
    """For a spread of a thousand standard deviations the shrinkage is a millionth."""
    values = np.array([-4e3, 0.0, 1e3, 5e3])
    found = population_of(values, np.ones(4), 1e3)

    assert found.groups[:, 1] == pytest.approx(values, abs=0.02)
    assert found.groups[:, 2] - found.groups[:, 1] == pytest.approx(1.645, abs=0.01)


def test_equal_groups_share_one_mean() -> None:
    """With a prior that allows no spread, each group has the weighted mean and its interval."""
    _, values, sds = drawn(1.0, np.random.default_rng(2))
    found = population_of(values, sds, 1e-6)
    weights = sds**-2.0
    mean, sd = weights @ values / weights.sum(), weights.sum() ** -0.5

    assert found.groups[:, 1] == pytest.approx(mean, abs=1e-3)
    assert found.groups[:, 2] == pytest.approx(mean + 1.645 * sd, abs=1e-3)


def test_spread_agrees_with_paule_and_mandel() -> None:
    """With 400 groups the prior has no weight; Paule and Mandel (1982) solve Q(tau) = n - 1."""
    _, values, sds = drawn(1.3, np.random.default_rng(3), 400)

    def excess(tau: float) -> float:
        weights = 1.0 / (sds**2 + tau**2)
        return float(weights @ (values - weights @ values / weights.sum()) ** 2 - 399.0)

    moment = optimize.brentq(excess, 0.0, 10.0)
    low, median, high = population_of(values, sds, 1.0).spread

    assert low < 1.3 < high
    assert median == pytest.approx(moment, abs=0.5 * (high - low))


def test_group_without_an_estimate_has_the_distribution_of_its_population() -> None:
    """Its interval is that of a new group, N(mu, tau^2 + var(mu)), and moves no other group."""
    _, values, sds = drawn(1.0, np.random.default_rng(4), 200)
    alone = population_of(values, sds, 1.0)
    found = population_of(np.append(values, 99.0), np.append(sds, np.inf), 1.0)

    assert found.groups[:-1] == pytest.approx(alone.groups)
    assert found.groups[-1, 1] == pytest.approx(alone.mean[1], abs=0.01)
    assert found.groups[-1, 2] - found.groups[-1, 0] == pytest.approx(
        3.29 * np.hypot(alone.spread[1], 0.07), rel=0.05
    )
