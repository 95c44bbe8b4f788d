"""One sample interval: step plans, and agreement of the matrix function algorithms."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.model.composite import INPUTS, MotorModel
from identification.model.step import step_function
from identification.model.step_plan import TOLERANCE, StepPlan, plan_for
from tests.motors import MOTORS, Motor, motor_named
from tests.terms import Lag, MagneticDrag

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")


def one_interval(interval: float, voltage: float, following: float) -> Array:
    """(n_input,) inputs of an interval in which the voltage changes between two values."""
    row = dict.fromkeys(INPUTS, 0.0)
    row.update(interval=interval, voltage=voltage, voltage_next=following)
    row.update(temperature=60.0, temperature_next=60.0, peak_temperature=60.0)
    return np.array([row[name] for name in INPUTS])


def by_exponential(values: Array, row: Array, state: Array, hold: str) -> Array:
    """State after the interval, by one exponential of the matrix augmented by the input."""
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = values
    heat = row[INPUTS.index("temperature")] - 25.0
    resistance, constant = ra * (1 + alpha_ra * heat), kt * (1 + alpha_kt * heat)
    interval, voltage, following = row[:3]
    whole = np.zeros((4, 4))
    whole[0] = [-resistance / inductance, -constant / inductance, 1 / inductance, 0.0]
    whole[1] = [constant / inertia, -friction / inertia, 0.0, 0.0]
    whole[2, 3] = (following - voltage) / interval if hold == "foh" else 0.0
    extended = expm(whole * interval) @ np.array([*state, voltage, 1.0])
    return np.asarray(extended[:2])


@given(rate=st.floats(1e-6, 60.0))
@settings(max_examples=200, deadline=None)
def test_a_series_is_truncated_below_the_tolerance(rate: float) -> None:
    """Term k of phi1 is z^(k-1)/k!; the first omitted one must be below the tolerance."""
    for linear in (False, True):
        plan = plan_for(rate, linear=linear)

        z = rate / 2**plan.squarings
        left_out = z**plan.terms / math.factorial(plan.terms + 1)
        assert left_out < TOLERANCE


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("rate", [math.inf, math.nan, 1e300])
def test_a_rate_without_bound_gets_a_plan_of_bounded_size(rate: float, linear: bool) -> None:
    """A diverging simulation must not generate a step of unlimited size."""
    plan = plan_for(rate, linear=linear)

    assert plan.squarings <= 60
    assert plan.terms <= 30


def test_a_plan_suits_the_rates_from_a_fifth_of_its_own() -> None:
    """Documented range: from a fifth of its rate up to its rate."""
    plan = plan_for(1.0)

    assert plan.suits(1.0)
    assert plan.suits(0.2)
    assert not plan.suits(1.01)
    assert not plan.suits(0.19)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("motor", MOTORS, ids=lambda motor: motor.name)
def test_a_linear_interval_is_the_matrix_exponential(motor: Motor, hold: str) -> None:
    """Reference: scipy's expm of the two balances, augmented by the voltage."""
    values = motor.vector
    row = one_interval(motor.interval, 0.3 * motor.voltage, motor.voltage)
    state = np.array([0.2 * motor.voltage / values[0], 0.5 * motor.voltage / values[2]])
    rate = motor.interval * 2 * values[0] / values[6]
    model = MotorModel(hold="foh" if hold == "foh" else "zoh")

    after = step_function(model, plan_for(rate, linear=True))(state, row, values)[0]

    expected = by_exponential(values, row, state, hold)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(np.asarray(after).ravel(), expected, rtol=1e-8, atol=1e-9 * scale)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@given(ratio=st.floats(1e-3, 1e3))
@settings(max_examples=30, deadline=None)
def test_an_interval_is_exact_for_any_electrical_time_constant(hold: str, ratio: float) -> None:
    """Reference: scipy's expm, for intervals from 1/1000 of L/R to 1000 L/R."""
    values = SERVO.vector
    values[6] = values[0] * SERVO.interval / ratio
    row = one_interval(SERVO.interval, 10.0, -4.0)
    state = np.array([3.0, 100.0])
    model = MotorModel(hold="foh" if hold == "foh" else "zoh")

    after = step_function(model, plan_for(1.5 * ratio, linear=True))(state, row, values)[0]

    expected = by_exponential(values, row, state, hold)
    np.testing.assert_allclose(np.asarray(after).ravel(), expected, rtol=1e-7, atol=1e-6)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_action_and_squaring_give_the_same_interval(hold: str) -> None:
    """Two algorithms for the same matrix functions; the third state selects the general ones."""
    model = MotorModel(hold="foh" if hold == "foh" else "zoh").adding(Lag())
    values = np.append(SERVO.vector, 0.002)
    row = one_interval(SERVO.interval, 10.0, -4.0)
    state = np.array([3.0, 100.0, 50.0])

    action = step_function(model, StepPlan(terms=16))(state, row, values)[0]
    squaring = step_function(model, StepPlan(terms=12, squarings=3))(state, row, values)[0]

    np.testing.assert_allclose(np.asarray(squaring), np.asarray(action), rtol=1e-11)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_state_that_acts_on_nothing_leaves_the_motor_alone(hold: str) -> None:
    """The closed form for two states and the general form for three give the same motor."""
    plain = MotorModel(hold="foh" if hold == "foh" else "zoh")
    row = one_interval(SERVO.interval, 10.0, -4.0)
    plan = StepPlan(terms=14)

    two = step_function(plain, plan)([3.0, 100.0], row, SERVO.vector)[0]
    three = step_function(plain.adding(Lag()), plan)(
        [3.0, 100.0, 50.0], row, np.append(SERVO.vector, 0.002)
    )[0]

    np.testing.assert_allclose(np.asarray(three)[:2], np.asarray(two), rtol=1e-12)


@pytest.mark.parametrize("squarings", [0, 4])
@pytest.mark.parametrize("terms", [(), (MagneticDrag(),), (Lag(),)], ids=["linear", "drag", "lag"])
def test_an_interval_of_zero_length_moves_nothing(
    squarings: int, terms: tuple[MagneticDrag | Lag, ...]
) -> None:
    """The last sample of a record has no interval after it."""
    model = MotorModel(terms, hold="foh")
    values = np.concatenate([SERVO.vector, [1e-6] if terms else []])
    row = one_interval(0.0, 10.0, 10.0)
    state = np.arange(3.0, 3.0 + len(model.state_names))
    plan = StepPlan(terms=9, squarings=squarings)

    after, logged = step_function(model, plan)(state, row, values)

    np.testing.assert_array_equal(np.asarray(after).ravel(), state)
    np.testing.assert_array_equal(np.asarray(logged).ravel(), state[:2])


def test_the_step_is_a_casadi_function_of_carry_inputs_and_parameters() -> None:
    """The nominal model has two states, the inputs and seven parameters."""
    step = step_function(MotorModel(), plan_for(0.4, linear=True))

    assert isinstance(step, ca.Function)
    assert [step.size1_in(k) for k in range(3)] == [2, len(INPUTS), 7]
    assert [step.size1_out(k) for k in range(2)] == [2, 2]
