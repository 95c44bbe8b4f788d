"""Tracing of a curved ridge: within the bounds and as far as the simulation is finite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.catalogue import CATALOGUE
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.normal_equations import normal_equations
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.posterior.density import Posterior
from identification.posterior.ridge import Ridge, ridge_of
from identification.posterior.sample import sample
from identification.selection.candidates import scales_of
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start
from tests.motors import Motor, campaign, motor_named
from tests.posterior.test_brushes import brushes_fitted
from tests.posterior.test_sample import WHITE, servo_fit

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")


def with_shifts(ridge: Ridge, shifts: Array) -> Ridge:
    """Ridge with shifts (5, n_parameter) up to two standard deviations to each side."""
    states = tuple(np.zeros((5, own.shape[1])) for own in ridge.states)
    return replace(ridge, abscissae=np.linspace(-2.0, 2.0, 5), shifts=shifts, states=states)


@pytest.fixture(scope="module")
def brushes() -> Fit:
    """Fit of brushes with the sharpest knee: a shape parameter is at its bound."""
    return brushes_fitted(0.03, seed=5)


def test_a_ridge_ends_where_the_motor_cannot_be_simulated() -> None:
    """L/R is 1/30 of the interval; further along the ridge the simulation overflows."""
    inductance = SERVO.values[0] * SERVO.interval / 30
    motor = Motor("fast", (*SERVO.values[:6], inductance), 24.0, SERVO.interval)
    fit = fit_declared(records_of(campaign(motor, seed=3, noise=0.05, rows=500)), "zoh")

    with np.errstate(over="ignore", invalid="ignore"):
        ridge = ridge_of(fit, WHITE)

    assert np.isfinite(ridge.shifts).all()
    assert np.isfinite(ridge.log_density).all()


def test_draws_along_a_bent_ridge_stay_within_the_bounds() -> None:
    """The ridge passes through an inductance of zero."""
    posterior = Posterior(servo_fit(), WHITE)
    fit = posterior.fit
    place = fit.coordinates.names.index("L")
    shifts = np.zeros((5, fit.position.size))
    shifts[:, place] = (fit.coordinates.lower - fit.position)[place] * np.array([6, 2, 0, 2, 6])
    straight = ridge_of(fit, WHITE)
    functional = straight.functional.copy()
    functional[place] = 0.0
    posterior.__dict__["ridge"] = with_shifts(replace(straight, functional=functional), shifts)

    draws = posterior.normal_draws(seed=5)

    assert draws["L"].min() >= 0.0


def test_straightening_is_the_inverse_of_bending() -> None:
    """A shear leaves the position along the ridge as it is, so that it has an inverse."""
    fit = servo_fit()
    straight = ridge_of(fit, WHITE)
    shifts = np.random.default_rng(1).standard_normal((5, fit.position.size))
    tangent = np.linalg.pinv(straight.functional[None, :])[:, 0]
    shifts -= np.outer(shifts @ straight.functional, tangent)
    ridge = with_shifts(straight, shifts)
    points = fit.position[:, None] + np.random.default_rng(2).standard_normal(
        (fit.position.size, 9)
    )

    np.testing.assert_allclose(ridge.straightened(ridge.bent(points)), points, rtol=1e-6, atol=1e-6)


def test_a_nearly_normal_posterior_has_no_ridge() -> None:
    """The ridge of a nearly normal posterior is straight and costs no evaluation."""
    assert ridge_of(servo_fit(), WHITE).is_straight


def test_from_a_bound_the_ridge_goes_inwards(brushes: Fit) -> None:
    """One parameter leaves its bound; the others are at their conditional optimum."""
    (bound,) = np.flatnonzero(brushes.position <= brushes.coordinates.lower)

    ridge = ridge_of(brushes, WHITE)

    assert brushes.coordinates.names[bound] == "brush_drop.openness"
    assert ridge.abscissae[0] == 0.0
    assert ridge.abscissae.size > 4
    assert np.all(np.diff(ridge.shifts[:, bound] + ridge.abscissae * ridge.tangent[bound]) > 0)


def test_along_the_ridge_the_other_parameters_are_optimal(brushes: Fit) -> None:
    """The gradient of the cost across the ridge is zero to 0.4 standard deviations."""
    ridge = ridge_of(brushes, WHITE)

    for k, abscissa in enumerate(ridge.abscissae):
        position = brushes.position + abscissa * ridge.tangent + ridge.shifts[k]
        moved = position - brushes.position
        states = [
            start + brushes.equations.state_response(r) @ moved + shift
            for r, (start, shift) in enumerate(
                zip(brushes.states, ridge.state_shifts(position), strict=True)
            )
        ]
        found = normal_equations(
            brushes.simulator, brushes.coordinates, position, states, brushes.weighting
        )
        across = ridge.basis.T @ found.gradient
        step = np.linalg.solve(ridge.basis.T @ found.matrix @ ridge.basis, across)
        assert np.sqrt(across @ step) < 0.4
        for matrix, gradient in zip(found.state_matrices, found.state_gradients, strict=True):
            assert np.sqrt(gradient @ np.linalg.solve(matrix, gradient)) < 0.4


def test_the_density_uses_the_initial_states_along_the_ridge() -> None:
    """Two deviations along the ridge, the initial states deviate from their linear response."""
    fit = servo_fit()
    posterior = Posterior(fit, WHITE)
    straight = ridge_of(fit, WHITE)
    ridge = with_shifts(straight, np.zeros((5, fit.position.size)))
    off = [np.outer([0, 0, 0, 0, 1], 30.0 * fit.weighting.deviation) for _ in fit.states]
    posterior.__dict__["ridge"] = replace(ridge, states=tuple(off))
    away = np.append(fit.position + 2.0 * straight.tangent, posterior.centre[-2:])

    density = posterior(np.array([posterior.centre, away]))

    moved = 2.0 * straight.tangent
    states = [
        (start + fit.equations.state_response(k) @ moved + off[k][4])[:, None]
        for k, start in enumerate(fit.states)
    ]
    values = fit.coordinates.values((fit.position + moved)[:, None])
    sums = fit.simulator.misfit(values, states, fit.weighting)[:, 0]
    rest = fit.weighting.sums_of_squares(fit.residuals())
    fall = 0.5 * np.sum((sums - rest) / fit.weighting.deviation**2)
    assert density[0] - density[1] == pytest.approx(fall, rel=1e-6)
    assert fall > 100.0


def test_a_posterior_with_a_long_tail_has_a_short_chain() -> None:
    """Drag is correlated with friction; proposals around the optimum alone took 19 steps."""
    measured = make_campaign(
        "servo_150w", [("quadratic_drag", 0.03)], seed=5, rows=800, training=2, validation=1
    )
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    declared = fit_declared(campaign_of(runs, []).training, "zoh")
    candidate = CATALOGUE["quadratic_drag"].candidates(scales_of(declared))[0]
    fit = refined(refitted_with(declared, candidate.term, [Start(candidate.starts[:, 0])]))

    convergence = sample(Posterior(fit, WHITE), seed=0, most_steps=600).convergence

    assert convergence.reached
    assert convergence.autocorrelation_time < 10.0


def test_a_curvature_of_zero_gives_a_finite_ridge() -> None:
    """A channel with one sample of 1e14 gives such a fit; it determines no direction."""
    fit = servo_fit()
    nothing = np.zeros_like(fit.equations.matrix)
    flat = replace(fit.equations, matrix=nothing, information=nothing)

    with np.errstate(all="ignore"):
        ridge = ridge_of(replace(fit, equations=flat), WHITE)

    assert np.isfinite(ridge.functional).all()
