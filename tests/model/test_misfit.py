"""Likelihood loop with interpolated transition matrices, and the records that exclude it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import Record, records_of
from identification.model.loop import STRIDE
from identification.model.misfit import is_slow, misfit_loop
from identification.model.scan import Scan, scan_of
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting
from tests.motors import Motor, drive, motor_named, run_of

Array = NDArray[np.float64]
Hold = Literal["zoh", "foh"]

SERVO = motor_named("servo 100 W")
STIFF = Motor("stiff", (*SERVO.values[:6], 6e-5), 24.0, 1e-3)


def warming(motor: Motor, rows: int, hold: Hold = "zoh") -> Run:
    """Run that warms by 3 K/s, with noise of 1 A and 10 rad/s."""
    rng = np.random.default_rng(rows)
    temperature = 40.0 + 3.0 * motor.interval * np.arange(rows, dtype=np.float64)
    run = run_of(motor, drive(motor, "steps", rows, rng), temperature, np.zeros(2), hold)
    return replace(
        run,
        current=run.current + rng.standard_normal(rows),
        speed=run.speed + 10.0 * rng.standard_normal(rows),
    )


def sums_by_hand(simulator: Simulator, values: Array, states: list[Array]) -> Array:
    """(2, n_lane) sums of squared residuals, computed from the simulated channels."""
    sums = np.zeros((2, values.shape[1]))
    for record, logged in zip(simulator.records, simulator.logged(values, states), strict=True):
        residual = record.measured[:, :, None] - logged
        sums += np.sum(record.weight[:, :, None] * residual**2, axis=0)
    return sums


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("motor", [SERVO, STIFF], ids=lambda motor: motor.name)
@pytest.mark.parametrize("rows", [3, STRIDE, STRIDE + 1, STRIDE + 2, 5 * STRIDE + 7])
def test_an_interpolated_transition_gives_the_sums_of_the_plain_one(
    rows: int, motor: Motor, hold: Hold
) -> None:
    """Reference: plain simulation of every interval, for whole and partial blocks of rows."""
    records = records_of([warming(motor, rows, hold), warming(motor, rows + 1, hold)])
    assert all(is_slow(record) for record in records)
    simulator = Simulator.fitting(MotorModel(hold=hold), records, motor.vector)
    values = motor.vector[:, None] * np.linspace(0.95, 1.05, 11)
    states = [initial_states(simulator.model, record) for record in records]

    sums = simulator.misfit(values, states, Weighting.white(records))

    # Within a block of 0.05 K, the transition is nonlinear by the square of a few thousandths.
    np.testing.assert_allclose(sums, sums_by_hand(simulator, values, states), rtol=1e-7)


@pytest.mark.parametrize("spoiled", ["time", "temperature", "short"])
def test_uneven_records_are_not_interpolated_and_still_right(spoiled: str) -> None:
    """Sampling jitter, a temperature jump and a record of two samples select the plain loop."""
    run = warming(SERVO, 100)
    assert run.temperature is not None
    (record,) = records_of([run])
    inputs = record.inputs.copy()
    if spoiled == "time":
        inputs[:-1, 0] *= np.random.default_rng(1).uniform(0.9, 1.1, 99)
    elif spoiled == "temperature":
        inputs[50:, 3] += 5.0
        inputs[49:, 4] += 5.0
    else:
        (record,) = records_of([warming(SERVO, 2)])
        inputs = record.inputs
    uneven = replace(record, inputs=inputs)
    assert not is_slow(uneven)
    simulator = Simulator.fitting(MotorModel(), [uneven], SERVO.vector)
    states = [initial_states(simulator.model, uneven)]
    values = SERVO.vector[:, None] * np.ones(3)

    sums = simulator.misfit(values, states, Weighting.white([uneven]))

    np.testing.assert_allclose(sums, sums_by_hand(simulator, values, states), rtol=1e-11)


def test_masked_samples_do_not_count_in_an_interpolated_loop() -> None:
    """Reference: sums over the samples that are not masked."""
    (record,) = records_of([warming(SERVO, 200)])
    weight = np.ones((200, 2))
    weight[50:80, 0] = 0.0
    masked: Record = replace(record, weight=weight)
    simulator = Simulator.fitting(MotorModel(), [masked], SERVO.vector)
    states = [initial_states(simulator.model, masked)]
    values = SERVO.vector[:, None] * np.ones(1)

    sums = simulator.misfit(values, states, Weighting.white([masked]))

    np.testing.assert_allclose(sums, sums_by_hand(simulator, values, states), rtol=1e-8)


def test_only_required_input_columns_are_read() -> None:
    """ZOH needs interval, voltage and both temperatures; FOH also needs the next voltage."""
    plan = Simulator.fitting(MotorModel(), records_of([warming(SERVO, 50)]), SERVO.vector).plan
    white = (0, 0)

    held = misfit_loop(MotorModel(), plan, white, weighted=False, interpolated=False)
    linear = misfit_loop(MotorModel(hold="foh"), plan, white, weighted=True, interpolated=False)

    assert held.columns == (0, 1, 3, 4)
    assert linear.columns == (0, 1, 2, 3, 4)
    assert held.scan.n_input == 4 + 2
    assert linear.scan.n_input == 5 + 2 + 2


def slow_and_fast() -> tuple[ca.Function, ca.Function, ca.Function]:
    """Step split into a part that is linear in the input and the rest, and the whole step.

    The carry is a state and the sum of the previous states.
    """
    x, u, p, q = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("p"), ca.SX.sym("q", 2)
    nothing = ca.SX(0, 1)
    prepared = ca.vertcat(p * u[0], 1 - 0.1 * u[0])
    prepare = ca.Function("prepare", [nothing, u, p], [nothing, prepared])

    def following(by: ca.SX) -> ca.SX:
        """Carry after a row."""
        return ca.vertcat(by[1] * x[0] + by[0] * u[1], x[1] + x[0])

    step = ca.Function("step", [x, u, q], [following(q), nothing])
    whole = ca.Function("step", [x, u, p], [following(prepared), nothing])
    return prepare, step, whole


@pytest.mark.parametrize("rows", [0, 1, 2, 3, STRIDE, STRIDE + 1, 2 * STRIDE + 1, 100])
def test_a_step_linear_in_the_row_is_interpolated_exactly(rows: int) -> None:
    """Reference: the whole step; the sum includes every state but the last."""
    prepare, step, whole = slow_and_fast()
    inputs = np.column_stack([np.linspace(0.5, 1.5, rows), np.sin(np.arange(rows))])
    parameters = np.array([[0.3, 0.7, 1.1]])
    carry = np.ones((2, 3))

    interpolated, _ = scan_of(step, prepare)([inputs], parameters, [carry])

    expected, _ = scan_of(whole)([inputs], parameters, [carry])
    np.testing.assert_allclose(interpolated[0][1], expected[0][1], rtol=1e-13)


def test_halves_that_do_not_fit_each_other_are_refused() -> None:
    """The second part takes two numbers, and the first prepares one."""
    _, step, _ = slow_and_fast()
    u, p, nothing = ca.SX.sym("u", 2), ca.SX.sym("p"), ca.SX(0, 1)
    short = ca.Function("prepare", [nothing, u, p], [nothing, p * u[0]])

    with pytest.raises(ValueError, match=r"are \(2, 1, 0\); the step takes \(2, 2\)"):
        Scan(step, short)
