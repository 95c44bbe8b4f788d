"""A bent ridge is followed as far as the motor can be simulated, and never out of the bounds."""

from __future__ import annotations

import numpy as np

from identification.fit.declared import fit_declared
from identification.model.excitation import records_of
from identification.posterior.density import Posterior
from identification.posterior.normal import normal_draws
from identification.posterior.ridge import Ridge, ridge_of
from tests.motors import Motor, campaign, motor_named
from tests.posterior.test_sample import WHITE, servo_fit

SERVO = motor_named("servo 100 W")


def test_a_ridge_ends_where_the_motor_cannot_be_simulated() -> None:
    """An inductance of a thirtieth of an interval: further along the ridge the steps overflow."""
    inductance = SERVO.values[0] * SERVO.interval / 30
    motor = Motor("fast", (*SERVO.values[:6], inductance), 24.0, SERVO.interval)
    fit = fit_declared(records_of(campaign(motor, seed=3, noise=0.05, rows=500)), "zoh")

    with np.errstate(over="ignore", invalid="ignore"):
        ridge = ridge_of(fit)

    assert np.isfinite(ridge.shifts).all()


def test_draws_along_a_bent_ridge_stay_within_the_bounds() -> None:
    """A ridge that bends through an inductance of zero, half a deviation from the optimum."""
    posterior = Posterior(servo_fit(), WHITE)
    fit = posterior.fit
    place = fit.coordinates.names.index("L")
    shifts = np.zeros((5, fit.position.size))
    shifts[:, place] = (fit.coordinates.lower - fit.position)[place] * np.array([6, 2, 0, 2, 6])
    straight = ridge_of(fit)
    along = straight.along.copy()
    along[place] = 0.0
    bent = Ridge(fit.position, along, np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), shifts)
    posterior.__dict__["ridge"] = bent

    draws = normal_draws(posterior, seed=5)

    assert draws["L"].min() >= 0.0


def test_straightening_takes_back_what_bending_did() -> None:
    """A shear leaves the way along the ridge as it is, so that it has an inverse."""
    fit = servo_fit()
    straight = ridge_of(fit)
    shifts = np.random.default_rng(1).standard_normal((5, fit.position.size))
    tangent = np.linalg.pinv(straight.along[None, :])[:, 0]
    shifts -= np.outer(shifts @ straight.along, tangent)
    ridge = Ridge(fit.position, straight.along, np.linspace(-2, 2, 5), shifts)
    points = fit.position[:, None] + np.random.default_rng(2).standard_normal(
        (fit.position.size, 9)
    )

    np.testing.assert_allclose(ridge.straightened(ridge.bent(points)), points, rtol=1e-6, atol=1e-6)
