"""Steps of the optimiser: within the bounds, and long enough."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bench import make_campaign
from identification.arrays import Array
from identification.fit.declared import fit_declared
from identification.fit.normal_equations import normal_equations
from identification.fit.solve import Fit, TerminationLimits, optimised
from identification.fit.trial_steps import cost_of, trial_steps
from identification.model.parameter import Coordinates
from tests.effects.hidden import records_of_bench


@cache
def servo_fit() -> Fit:
    """Fit of a servo without hidden effects, all parameters inside their ranges."""
    measured = make_campaign("servo_150w", [], seed=3, rows=400, training=1, validation=1)
    return fit_declared(records_of_bench(measured).training, "zoh")


@given(seed=st.integers(0, 2**32 - 1), correlation=st.floats(0.0, 0.999))
@settings(max_examples=200, deadline=None)
def test_a_step_is_the_optimum_of_the_quadratic_model_within_the_bounds(
    seed: int, correlation: float
) -> None:
    """No bound is crossed, and each parameter at a bound is pulled against it."""
    servo = servo_fit()
    rng = np.random.default_rng(seed)
    size = servo.position.size
    mixed = rng.standard_normal((size, size))
    matrix = (1.0 - correlation) * np.eye(size) + correlation * mixed @ mixed.T
    gradient = 3.0 * rng.standard_normal(size)
    room = rng.choice([0.0, 0.1, 1.0, 100.0], (2, size))
    coordinates = _between(servo, servo.position - room[0], servo.position + room[1])
    equations = replace(servo.equations, matrix=matrix, gradient=gradient)

    step = equations.steps(np.zeros(1), servo.position, coordinates)[0][:, 0]

    least, most = coordinates.lower - servo.position, coordinates.upper - servo.position
    assert np.all((step >= least - 1e-9) & (step <= most + 1e-9))
    pull = (gradient - matrix @ step) / np.sqrt(np.diag(matrix))
    assert np.all(pull[step > least + 1e-9] > -1e-5), "a smaller value would be better"
    assert np.all(pull[step < most - 1e-9] < 1e-5), "a larger value would be better"


def test_a_step_is_lengthened_where_the_curvature_is_overstated() -> None:
    """A matrix that is 50 times too large makes the step 50 times too short."""
    servo = servo_fit()
    position = servo.position + 2.0 * servo.equations.covariance()[0] / np.sqrt(
        servo.equations.covariance()[0, 0]
    )
    exact = normal_equations(
        servo.simulator, servo.coordinates, position, servo.states, servo.weighting
    )
    overstated = replace(exact, matrix=50.0 * exact.matrix)
    cost = _cost(servo, position)

    gains = []
    for equations in (exact, overstated):
        expected = cost, equations.decrement_within(position, servo.coordinates)
        start = position, list(servo.states)
        _, costs, _ = trial_steps(
            equations, servo.coordinates, start, expected, servo.weighting, np.zeros(8)
        )
        gains.append(cost - costs.min())

    assert gains[0] > 1.0
    assert gains[1] > 0.8 * gains[0]


def test_a_fit_ends_when_a_comparison_is_decided() -> None:
    """Compared with a model that is better by 10,000, it ends within a tenth of this difference."""
    servo = servo_fit()
    start = servo.position + 0.3
    limits = TerminationLimits(reference=servo.cost - 1e4)

    found = optimised(servo.simulator, servo.coordinates, start, servo.states, limits=limits)

    assert found.converged
    assert servo.cost - 1e-3 < found.cost < servo.cost + 1e3


def _between(fit: Fit, lower: Array, upper: Array) -> Coordinates:
    """Coordinates with other bounds, given in search coordinates."""
    least, most = fit.coordinates.values(lower), fit.coordinates.values(upper)
    return Coordinates(
        [
            replace(p, lower=float(low), upper=float(high))
            for p, low, high in zip(fit.coordinates.parameters, least, most, strict=True)
        ]
    )


def _cost(fit: Fit, position: Array) -> float:
    costs, _ = cost_of(
        fit.simulator, fit.coordinates, position[:, None], list(fit.states), fit.weighting
    )
    return float(costs[0])
