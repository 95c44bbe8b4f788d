"""Tangents, misfits and states of the simulator against independent references."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.model.composite import MotorModel
from identification.model.excitation import Record, records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.step_plan import StepPlan, stiffness
from identification.model.substeps import evenly
from identification.model.tangent import tangent, tangent_blocks
from identification.model.term import AbstractTerm
from identification.model.weighting import Weighting
from tests.motors import Motor, campaign, motor_named, noiseless
from tests.terms import Lag, MagneticDrag

Array = NDArray[np.float64]
Hold = Literal["zoh", "foh"]

SERVO = motor_named("servo 100 W")
STIFF = Motor("stiff", (*SERVO.values[:6], 6e-6), 24.0, 1e-3)
PAPER = motor_named("paper")


def case(
    motor: Motor, hold: Hold, terms: tuple[AbstractTerm, ...], own: tuple[float, ...]
) -> tuple[Simulator, Array, list[Array]]:
    """Simulator over two short runs, true values, and initial states in motion."""
    runs = noiseless(motor, seed=1, runs=2, rows=120, hold=hold)
    records = records_of(runs)
    model = MotorModel(terms, hold=hold)
    values = np.concatenate([motor.vector, own])
    states = [initial_states(model, record) + 1.0 + k for k, record in enumerate(records)]
    return Simulator.fitting(model, records, values), values, states


CASES = {
    "servo": (SERVO, (), ()),
    "electrically stiff": (STIFF, (), ()),
    "paper": (PAPER, (), ()),
    "with drag": (SERVO, (MagneticDrag(),), (2e-6,)),
    "with a state": (SERVO, (Lag(),), (0.01,)),
}


def central_difference(simulator: Simulator, values: Array, states: list[Array], row: int) -> Array:
    """Derivative (n_sample, 2) with respect to a parameter or an initial state of record 0.

    A central difference with relative step s has an error of s^2 from the curvature and of 1e-16/s
    from rounding (for signals of magnitude 1); both are below 1e-9 at s = 1e-5.
    """
    n = values.size
    size = abs(values[row]) if row < n else max(abs(states[0][row - n]), 1.0)
    step = 1e-5 * size
    ends = []
    for sign in (1.0, -1.0):
        moved, start = values.copy(), [x.copy() for x in states]
        if row < n:
            moved[row] += sign * step
        else:
            start[0][row - n] += sign * step
        ends.append(simulator.logged(moved[:, None], start)[0][:, :, 0])
    return np.asarray((ends[0] - ends[1]) / (2 * step))


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", CASES)
def test_tangents_are_derivatives_by_parameters_and_initial_states(name: str, hold: Hold) -> None:
    """Reference: central differences; their docstring derives the step."""
    simulator, values, states = case(CASES[name][0], hold, CASES[name][1], CASES[name][2])

    _, tangents = tangent(simulator, values, states, np.eye(values.size))

    for row in range(tangents[0].shape[2]):
        expected = central_difference(simulator, values, states, row)
        size = np.abs(expected).max()
        np.testing.assert_allclose(tangents[0][:, :, row], expected, atol=2e-6 * size, rtol=0)


def test_tangents_come_with_the_simulation_itself() -> None:
    """Reference: plain simulation of the same values."""
    simulator, values, states = case(SERVO, "foh", (), ())

    logged, _ = tangent(simulator, values, states, np.eye(7))

    for ours, plain in zip(logged, simulator.logged(values[:, None], states), strict=True):
        np.testing.assert_allclose(ours, plain[:, :, 0], rtol=1e-12)


def test_a_tangent_in_a_direction_is_the_sum_of_its_parts() -> None:
    """Derivatives are linear in the direction."""
    simulator, values, states = case(SERVO, "zoh", (), ())
    direction = np.linspace(-1.0, 1.0, 7) * values

    _, single = tangent(simulator, values, states, np.eye(7))
    _, mixed = tangent(simulator, values, states, direction[:, None])

    expected = single[0][:, :, :7] @ direction
    np.testing.assert_allclose(mixed[0][:, :, 0], expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("lead", [0, 4])
@pytest.mark.parametrize("name", ["servo", "with a state"])
def test_tangents_in_blocks_are_those_of_the_whole_record(name: str, lead: int, parts: int) -> None:
    """Each block continues where the previous one ended, so the results are equal bit for bit."""
    simulator, values, states = case(CASES[name][0], "zoh", CASES[name][1], CASES[name][2])
    simulator = replace(
        simulator, substeps=evenly([record.rows for record in simulator.records], parts)
    )
    logged, tangents = tangent(simulator, values, states, np.eye(values.size))
    counted = np.zeros((2, 120))

    for block in tangent_blocks(simulator, values, states, np.eye(values.size), lead, rows=34):
        assert block.lead == (0 if block.start == 0 else lead)
        assert np.array_equal(block.logged, logged[block.record][block.samples])
        assert np.array_equal(block.tangent, tangents[block.record][block.samples])
        counted[block.record, block.samples][block.lead :] += 1
    assert (counted == 1).all()


def uneven_weights(records: list[Record], seed: int) -> tuple[list[Record], tuple[Array, ...]]:
    """Records with 30 % of the samples masked, and robust weights between 0.1 and 1."""
    rng = np.random.default_rng(seed)
    masked = [
        replace(record, weight=(rng.random(record.weight.shape) > 0.3).astype(float))
        for record in records
    ]
    return masked, tuple(rng.uniform(0.1, 1.0, record.weight.shape) for record in records)


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize(
    "whitening", [([1.0], [1.0]), ([1.0, -0.8], [1.0]), ([1.0, -0.5, 0.2], [1.0, -0.9])]
)
def test_the_misfit_is_the_weighted_sum_of_whitened_residuals(
    whitening: tuple[list[float], list[float]], robust: bool
) -> None:
    """Reference: simulated channels filtered by scipy, lane by lane."""
    records, sizes = uneven_weights(records_of(campaign(SERVO, seed=2, runs=2, rows=150)), seed=3)
    simulator = Simulator.fitting(MotorModel(), records, SERVO.vector)
    taps = (np.array(whitening[0]), np.array(whitening[1]))
    weighting = replace(Weighting.white(records), whitening=taps, robust=sizes if robust else None)
    values = SERVO.vector[:, None] * np.linspace(0.9, 1.1, 5)
    states = [initial_states(simulator.model, record) for record in records]

    sums = simulator.misfit(values, states, weighting)

    expected = np.zeros((2, 5))
    for k, (record, logged) in enumerate(
        zip(records, simulator.logged(values, states), strict=True)
    ):
        weight = record.weight * (sizes[k] if robust else 1.0)
        for channel in range(2):
            residual = record.measured[:, channel, None] - logged[:, channel]
            white = lfilter(taps[channel], [1.0], residual, axis=0)
            expected[channel] += weight[:, channel] @ white**2
    np.testing.assert_allclose(sums, expected, rtol=1e-11)


def test_the_misfit_follows_a_change_of_weights() -> None:
    """Cached rows must be discarded when the weights change."""
    records = records_of(campaign(SERVO, seed=2, runs=2, rows=100))
    simulator = Simulator.fitting(MotorModel(), records, SERVO.vector)
    states = [initial_states(simulator.model, record) for record in records]
    values = SERVO.vector[:, None] * np.ones(2)
    plain = Weighting.white(records)
    halved = replace(plain, robust=tuple(np.full((100, 2), 0.5) for _ in records))

    before = simulator.misfit(values, states, plain)
    half = simulator.misfit(values, states, halved)
    after = simulator.misfit(values, states, plain)

    np.testing.assert_allclose(half, 0.5 * before, rtol=1e-12)
    np.testing.assert_array_equal(after, before)


def test_the_sums_of_squares_of_the_weighting_are_the_misfit() -> None:
    """The sums are computed twice: from residuals, and within the loop."""
    records, sizes = uneven_weights(records_of(campaign(SERVO, seed=4, runs=2, rows=90)), seed=5)
    simulator = Simulator.fitting(MotorModel(), records, SERVO.vector)
    states = [initial_states(simulator.model, record) for record in records]
    weighting = replace(
        Weighting.white(records),
        whitening=(np.array([1.0, -0.7]), np.array([1.0, 0.3])),
        robust=sizes,
    )
    logged = simulator.logged(SERVO.vector[:, None], states)
    residuals = [r.measured - y[:, :, 0] for r, y in zip(records, logged, strict=True)]

    sums = weighting.sums_of_squares(residuals)

    expected = simulator.misfit(SERVO.vector[:, None], states, weighting)[:, 0]
    np.testing.assert_allclose(sums, expected, rtol=1e-11)


def test_a_simulation_that_diverges_has_infinite_cost() -> None:
    """A lane with negative inertia diverges and must not affect the lane of the true values."""
    records = records_of(campaign(SERVO, seed=2, runs=1, rows=3000))
    simulator = Simulator.fitting(MotorModel(), records, SERVO.vector)
    states = [initial_states(simulator.model, records[0])]
    runaway = SERVO.vector.copy()
    runaway[4] *= -1e-3
    weighting = Weighting.white(records)

    with np.errstate(all="ignore"):
        sums = simulator.misfit(np.column_stack([SERVO.vector, runaway]), states, weighting)
    sized, cost = weighting.sized(sums)

    assert np.isfinite(cost[0])
    assert cost[1] == np.inf
    assert np.all(sized.deviation < weighting.deviation)


def test_the_best_deviation_is_the_root_mean_square_of_the_residual() -> None:
    """Closed form: the likelihood of N errors is largest at sqrt(sum of squares / N)."""
    records = records_of(campaign(SERVO, seed=2, runs=1, rows=400))
    weighting = Weighting.white(records)

    sized, cost = weighting.sized(np.array([400.0 * 0.3**2, 400.0 * 7.0**2]))

    np.testing.assert_allclose(sized.deviation, [0.3, 7.0])
    np.testing.assert_allclose(cost, [400.0 * np.log(0.3 * 7.0)])


def test_all_states_over_time_start_with_the_logged_ones() -> None:
    """Without sensor dynamics, current and speed are the logged channels."""
    simulator, values, states = case(SERVO, "zoh", (Lag(),), (0.01,))

    over_time = simulator.states(values[:, None], states)

    logged = simulator.logged(values[:, None], states)
    for trajectory, channels in zip(over_time, logged, strict=True):
        assert trajectory.shape == (120, 3, 1)
        np.testing.assert_allclose(trajectory[:, :2], channels, rtol=1e-12)


def test_the_rate_is_the_spectral_radius_of_the_interval() -> None:
    """Reference: numpy's eigenvalues of the two balances at the hottest sample."""
    records = records_of(noiseless(SERVO, seed=1, runs=1, rows=200))
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = SERVO.values
    radius = 0.0
    for heat in records[0].column("temperature") - 25.0:
        constant = kt * (1 + alpha_kt * heat)
        matrix = [
            [-ra * (1 + alpha_ra * heat) / inductance, -constant / inductance],
            [constant / inertia, -friction / inertia],
        ]
        radius = max(radius, float(np.abs(np.linalg.eigvals(np.array(matrix))).max()))

    states = [initial_states(MotorModel(), record) for record in records]
    rate = stiffness(MotorModel(), records, SERVO.vector, states)

    assert rate == pytest.approx(radius * SERVO.interval, rel=1e-9)


def test_a_plan_with_room_to_spare_gives_the_same_simulation() -> None:
    """Additional terms change nothing above the tolerance of the series."""
    simulator, values, states = case(SERVO, "zoh", (), ())
    generous = replace(simulator, plan=StepPlan(terms=18))

    plain = simulator.logged(values[:, None], states)[0]

    expected = generous.logged(values[:, None], states)[0]
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(plain / size, expected / size, atol=1e-8)
