"""Posterior sampling: density, spread, and marginalised initial states."""

from __future__ import annotations

import functools
from dataclasses import replace

import emcee
import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.fit.identifiability import identified
from identification.fit.own_states import state_precision
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.model.simulate import initial_states
from identification.posterior.density import Posterior
from identification.posterior.sample import Sample, sample
from tests.motors import NAMES, Motor, campaign, motor_named

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")
WHITE = 1.0


@functools.cache
def servo_fit() -> Fit:
    """Fit of the servo motor with a nearly normal posterior."""
    return fit_declared(records_of(campaign(SERVO, seed=1, noise=0.01, rows=700)), "zoh")


@functools.cache
def servo_sample() -> Sample:
    """Sampled posterior of that fit."""
    return sample(Posterior(servo_fit(), WHITE), seed=7)


def flat(chain: Sample) -> Array:
    """All draws (n_draw, n_dim)."""
    return chain.chain.reshape(-1, chain.chain.shape[2])


def test_the_density_is_the_likelihood_and_the_prior() -> None:
    """Reference: likelihood and prior written out from the residuals of the fit."""
    fit = servo_fit()
    posterior = Posterior(fit, WHITE)
    deviation = fit.weighting.deviation * np.array([1.1, 0.9])
    point = np.append(fit.position, np.log(deviation))

    density = posterior(np.array([point]))[0]

    residual = np.concatenate(fit.residuals())
    likelihood = -np.sum(np.log(deviation) + 0.5 * (residual / deviation) ** 2)
    assert density == pytest.approx(likelihood + fit.coordinates.log_prior(fit.position), rel=1e-10)


def test_the_density_falls_according_to_the_covariance() -> None:
    """A step of two standard deviations lowers a normal log density by 2."""
    posterior = Posterior(servo_fit(), WHITE)
    root = np.linalg.cholesky(posterior.covariance())
    directions = np.random.default_rng(2).standard_normal((40, root.shape[0]))
    directions *= 2.0 / np.linalg.norm(directions, axis=1)[:, None]

    fall = posterior(posterior.centre[None, :])[0] - posterior(
        posterior.centre + directions @ root.T
    )

    np.testing.assert_allclose(fall, 2.0, atol=0.5)


def test_a_smaller_effective_share_widens_the_posterior() -> None:
    """A quarter of the samples doubles every sd and divides the fall of the log density by 4."""
    fit = servo_fit()
    all_of_it, quarter = Posterior(fit, WHITE), Posterior(fit, 0.25)
    centre = all_of_it.centre
    away = centre + np.append(np.sqrt(np.diag(fit.equations.covariance())), [0.0, 0.0])

    def fall(posterior: Posterior) -> float:
        """Decrease of the log density, without that of the prior."""
        ends = posterior(np.array([centre, away]))
        prior = fit.coordinates.log_prior(np.column_stack([centre[:7], away[:7]]))
        return float((ends[0] - prior[0]) - (ends[1] - prior[1]))

    assert fall(quarter) == pytest.approx(0.25 * fall(all_of_it), rel=1e-9)


def test_the_normal_approximation_is_as_wide_as_the_density() -> None:
    """Half an sd along the least certain direction lowers the log density by 1/8."""
    for share in (WHITE, 0.7, 0.1):
        posterior = Posterior(servo_fit(), share)
        values, vectors = np.linalg.eigh(posterior.covariance())
        step = 0.5 * np.sqrt(values[-1]) * vectors[:, -1]
        ends = posterior(posterior.centre + np.array([0.0, 1.0, -1.0])[:, None] * step)

        assert np.mean(ends[0] - ends[1:]) == pytest.approx(0.125, rel=0.05)


def test_the_density_is_zero_out_of_bounds() -> None:
    """Infinite coordinates and values below a bound have zero density and are not simulated."""
    posterior = Posterior(servo_fit(), WHITE)
    beyond = np.tile(posterior.centre, (2, 1))
    beyond[0, 6] = posterior.fit.coordinates.lower[6] - 1.0
    beyond[1, 0] = 1e6

    with np.errstate(all="ignore"):
        density = posterior(beyond)

    assert np.all(density == -np.inf)


def test_each_walker_has_its_own_density() -> None:
    """Reference: one walker at a time."""
    posterior = Posterior(servo_fit(), WHITE)
    root = np.linalg.cholesky(posterior.covariance())
    points = posterior.centre + np.random.default_rng(3).standard_normal((11, 9)) @ root.T

    together = posterior(points)

    alone = [posterior(point[None, :])[0] for point in points]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_the_sampled_spread_is_that_of_the_normal_equations() -> None:
    """Nearly normal by construction; 1000 independent draws estimate an sd to 2.3 %."""
    chain = servo_sample()
    posterior = Posterior(servo_fit(), WHITE)

    points = np.column_stack(
        [posterior.fit.coordinates.of(flat(chain)[:, :7].T).T, np.log(flat(chain)[:, 7:])]
    )

    assert chain.convergence.ess_min > 500
    covariance = posterior.covariance()
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(points.std(axis=0), deviation, rtol=0.12)
    np.testing.assert_allclose((points.mean(axis=0) - posterior.centre) / deviation, 0, atol=0.2)
    correlation = np.corrcoef(points.T)
    np.testing.assert_allclose(correlation, covariance / np.outer(deviation, deviation), atol=0.12)


def test_the_chain_reports_convergence() -> None:
    """Fifty autocorrelation times, equal halves, and an acceptance between the limits."""
    found = servo_sample().convergence

    assert found.reached
    assert found.steps >= 50 * found.autocorrelation_time
    assert found.r_hat_max < 1.05
    assert 0.1 < found.acceptance < 0.95


def test_a_chain_that_stops_by_itself_has_converged() -> None:
    """Stopping rule and diagnostics both use the chain after burn-in, so they agree."""
    posterior = Posterior(servo_fit(), WHITE)

    found = [sample(posterior, seed=seed).convergence for seed in range(8)]

    assert all(one.reached for one in found)


def test_a_chain_that_was_stopped_early_is_reported() -> None:
    """Fifty steps are fewer than fifty autocorrelation times."""
    found = sample(Posterior(servo_fit(), WHITE), seed=7, most_steps=50)

    assert not found.convergence.reached


def test_the_same_seed_gives_the_same_chain() -> None:
    """The chain depends on the seed only; another seed gives another chain."""
    posterior = Posterior(servo_fit(), WHITE)

    first, again, other = (sample(posterior, seed=s, most_steps=50) for s in (3, 3, 4))

    np.testing.assert_array_equal(first.chain, again.chain)
    assert not np.array_equal(first.chain, other.chain)


def test_progress_is_reported_as_a_fraction_that_ends_near_one() -> None:
    """The fraction suits a progress bar; the chain ends at or soon after 50 times."""
    told: list[float] = []

    sample(Posterior(servo_fit(), WHITE), seed=7, progress=told.append)

    assert all(0.0 < fraction <= 1.0 for fraction in told)
    assert told[-1] > 0.7


def test_draws_are_spread_over_the_chain_by_name() -> None:
    """Every column of the chain is given by name, thinned evenly."""
    chain = servo_sample()

    draws = chain.draws(most=500)

    assert tuple(draws) == (*NAMES, "noise_current_A", "noise_speed_rad_s")
    assert {values.size for values in draws.values()} == {500}
    assert draws["Ra25"][0] == flat(chain)[0, 0]
    assert draws["Ra25"][-1] == flat(chain)[-1, 0]


def test_draws_of_the_normal_approximation_have_its_spread() -> None:
    """4000 independent draws estimate an sd to 1.1 %."""
    posterior = Posterior(servo_fit(), WHITE)

    draws = posterior.normal_draws(seed=5, count=4000)

    sd = np.sqrt(np.diag(servo_fit().equations.covariance()))
    points = servo_fit().coordinates.of(np.array([draws[name] for name in NAMES]))
    np.testing.assert_allclose(points.std(axis=1), sd, rtol=0.05)


def test_an_unidentified_inductance_stays_wide_and_above_its_bound() -> None:
    """L/R is 1 % of the interval: the posterior extends from the bound to far above it."""
    ra = SERVO.values[0]
    motor = Motor("fast", (*SERVO.values[:6], ra * SERVO.interval / 100), 24.0, SERVO.interval)
    fit = fit_declared(records_of(campaign(motor, seed=8, noise=0.05, rows=500)), "zoh")
    assert not identified(fit, WHITE)["L"]

    chain = sample(Posterior(fit, WHITE), seed=1, most_steps=400)

    inductance = chain.draws()["L"]
    bound = fit.coordinates.values(fit.coordinates.lower)[6]
    assert inductance.min() >= bound * (1 - 1e-12)
    low, high = np.quantile(inductance, [0.05, 0.95])
    assert high > 3.0 * low
    assert low < motor.values[6] * 3.0
    assert high > motor.values[6] * 0.5


def with_explicit_states(fit: Fit) -> emcee.EnsembleSampler:
    """Sample parameters, noise and initial states explicitly; return the sampler."""
    n, records = fit.position.size, fit.simulator.records
    posterior = Posterior(fit, WHITE)

    def density(points: Array) -> Array:
        """Log density (n_walker,) of points (n_walker, n + 2 + 2 n_record)."""
        position = points[:, :n].T
        prior = fit.coordinates.log_prior(position)
        states = []
        for k, record in enumerate(records):
            state = points[:, n + 2 + 2 * k : n + 4 + 2 * k].T
            states.append(state)
            off = state - initial_states(fit.simulator.model, record)[:, None]
            prior = prior - 0.5 * np.sum(
                state_precision(fit.simulator, k)[:, None] * off**2, axis=0
            )
        sums = fit.simulator.misfit(fit.coordinates.values(position), states, fit.weighting)
        logs = points[:, n : n + 2].T
        counts = fit.weighting.counts[:, None]
        fall = np.sum(counts * logs + 0.5 * sums * np.exp(-2 * logs), axis=0)
        return np.asarray(np.where(np.isfinite(prior - fall), prior - fall, -np.inf))

    rng = np.random.default_rng(0)
    n_dim = n + 2 + 2 * len(records)
    root = np.linalg.cholesky(posterior.covariance())
    start = np.empty((64, n_dim))
    start[:, : n + 2] = posterior.centre + rng.standard_normal((64, n + 2)) @ root.T
    for k, state in enumerate(fit.states):
        moved = (start[:, :n] - fit.position) @ fit.equations.state_response(k).T
        spread = np.linalg.cholesky(np.linalg.inv(fit.equations.state_matrices[k]))
        start[:, n + 2 + 2 * k : n + 4 + 2 * k] = (
            state + moved + rng.standard_normal((64, 2)) @ spread.T
        )
    sampler = emcee.EnsembleSampler(64, n_dim, density, vectorize=True, moves=emcee.moves.DEMove())
    seeded = emcee.State(start, random_state=np.random.RandomState(1).get_state())  # noqa: NPY002
    sampler.run_mcmc(seeded, 2000, skip_initial_state_check=True)
    return sampler


def test_integrating_the_initial_states_out_equals_sampling_them() -> None:
    """Two short records, where initial states matter: means and deviations agree."""
    runs = campaign(SERVO, seed=9, noise=0.05, runs=2, rows=120)
    fit = fit_declared(records_of(runs), "zoh")
    known = [0, 2, 4, 6]  # Ra25, Kt25, J, L; two records hardly determine the others

    ours = flat(sample(Posterior(fit, WHITE), seed=2))
    explicit = with_explicit_states(fit).get_chain(discard=500, flat=True)

    expected = fit.coordinates.values(explicit[:, :7].T).T
    for k in known:
        assert ours[:, k].mean() == pytest.approx(
            expected[:, k].mean(), abs=0.25 * expected[:, k].std()
        )
        assert ours[:, k].std() == pytest.approx(expected[:, k].std(), rel=0.15)


def test_a_wrong_covariance_fails_the_comparison_as_a_negative_control() -> None:
    """Half the noise halves every sd, which the tolerance above must detect."""
    fit = servo_fit()
    narrow = replace(fit, equations=replace(fit.equations, matrix=4.0 * fit.equations.matrix))

    chain = servo_sample()

    deviation = np.sqrt(np.diag(Posterior(narrow, WHITE).covariance()))[:7]
    points = fit.coordinates.of(flat(chain)[:, :7].T).T
    assert np.all(np.abs(points.std(axis=0) / deviation - 1.0) > 0.12)
