"""Order tracking: an angle integrated from a noisy speed follows the torque of its order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.effects.periodic import CoggingTorque
from identification.fit.order_tracking import path_penalty, tracked
from identification.fit.solve import solve
from identification.fit.tracked_fit import slow_noise, solve_tracked
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting
from tests.motors import motor_named

Array = NDArray[np.float64]

ORDER, TORQUE, SPEED_NOISE, INTERVAL, ROWS = 20.0, 0.004, 1.0, 1e-3, 6000
SERVO = motor_named("servo 100 W")


def _slow_run(
    rng: np.random.Generator, *, has_cogging: bool, memory: float = 0.0
) -> tuple[Simulator, Array, Array]:
    """A run at some tens of rad/s, its angle integrated from the noisy speed, and the true angle.

    The true angle is a state of the model that generates the run.  The noise has the variance of
    white noise and the correlation `memory` between successive samples.
    """
    time: Array = INTERVAL * np.arange(ROWS, dtype=np.float64)
    voltage = np.interp(time, time[::400], rng.uniform(-4.0, 4.0, time[::400].size))
    columns: dict[str, Array] = dict.fromkeys(INPUTS, np.zeros(ROWS))
    columns |= {"interval": np.append(np.diff(time), 0.0), "voltage": voltage, "time": time}
    columns |= {"voltage_next": np.append(voltage[1:], voltage[-1])}
    columns |= {name: np.full(ROWS, 25.0) for name in ("temperature", "temperature_next")}
    blank = Record(
        0, "run.csv", 0, time, np.column_stack([columns[name] for name in INPUTS]),
        np.zeros((ROWS, 2)), np.ones((ROWS, 2)),
    )  # fmt: skip
    turning = CoggingTorque(TORQUE, logged=False, angle="simulated")
    values = np.append(SERVO.values, ORDER)
    start = np.array([0.0, 0.0, TORQUE if has_cogging else 0.0, 0.0, 0.0, 0.0, 0.0])
    truth = Simulator.fitting(MotorModel((turning,)), [blank], values).converged(values, [start])
    states = truth.states(values[:, None], [start])[0][:, :, 0]
    angle = states[:, -1]
    noise = np.array([1e-3, SPEED_NOISE])
    white = rng.standard_normal((ROWS, 2))
    coloured = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=0)
    measured = states[:, :2] + noise * coloured
    moved = 0.5 * INTERVAL * (measured[1:, 1] + measured[:-1, 1])
    integrated = np.concatenate([[0.0], np.cumsum(moved)])
    logged = replace(blank.with_angle(integrated), measured=measured, raw_angle=None)
    model = MotorModel((CoggingTorque(TORQUE, logged=False, angle="integrated"),))
    return Simulator.fitting(model, [logged], values), values, angle


def _phase_errors(simulator: Simulator, angle: Array) -> float:
    """RMS phase error of the order, up to a constant and to whole periods of the torque [rad]."""
    turned = np.exp(1j * ORDER * (simulator.records[0].column("angle") - angle))
    return float(np.sqrt(2.0 * (1.0 - abs(np.mean(turned)))))


def test_a_tracked_angle_turns_with_the_shaft_and_not_with_the_noise() -> None:
    """The noise of the speed leaves a random walk of up to 1.5 rad in the phase of the torque."""
    noise = np.array([1e-3, SPEED_NOISE])
    before, after = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        simulator, values, angle = _slow_run(rng, has_cogging=True)
        (start,) = [initial_states(simulator.model, record) for record in simulator.records]

        found, (state,) = tracked(simulator, values, [start], noise)

        before.append(_phase_errors(simulator, angle))
        after.append(_phase_errors(found, angle))
        names = found.model.state_names
        waves = [state[names.index(f"cogging_torque.{name}")] for name in ("sine", "cosine")]
        assert np.isclose(np.hypot(*waves), TORQUE, rtol=0.1)
        assert path_penalty(found, values, [state], noise, 1.0, 1.0) > 0
    assert np.mean(before) > 0.5
    assert max(after) < 0.3


def test_a_logged_angle_is_not_corrected() -> None:
    """An encoder has no drift."""
    rng = np.random.default_rng(4)
    simulator, values, _ = _slow_run(rng, has_cogging=True)
    (record,) = simulator.records
    encoder = replace(simulator, records=(replace(record, angle_logged=True),))

    after, _ = tracked(encoder, values, [np.zeros(len(encoder.model.state_names))], np.ones(2))

    assert after is encoder


def test_noise_alone_gains_less_than_the_path_costs() -> None:
    """A path and an amplitude through noise lower the misfit by less than they cost."""
    rng = np.random.default_rng(5)
    simulator, values, _ = _slow_run(rng, has_cogging=False)
    (start,) = [initial_states(simulator.model, record) for record in simulator.records]
    noise = np.array([1e-3, SPEED_NOISE])

    after, states = tracked(simulator, values, [start], noise)

    misfits = [
        0.5 * np.sum(((one.records[0].measured - y[:, :, 0]) / noise) ** 2)
        for one, y in (
            (simulator, simulator.logged(values[:, None], [start])[0]),
            (after, after.logged(values[:, None], states)[0]),
        )
    ]
    path = path_penalty(after, values, states, noise, 1.0, 1.0)
    assert misfits[0] - misfits[1] < np.log(ROWS) + path


def test_a_path_costs_as_much_whatever_noise_is_left() -> None:
    """A model that explains more leaves less slow noise; the drift of its angle is the same."""
    noise = np.array([1e-3, SPEED_NOISE])
    simulator, values, _ = _slow_run(np.random.default_rng(6), has_cogging=True, memory=0.9)
    (start,) = [initial_states(simulator.model, record) for record in simulator.records]
    found, states = tracked(simulator, values, [start], noise, 4.0)

    costs = [path_penalty(found, values, states, noise, slow, 1.0) for slow in (4.0, 2.0, 1.0)]

    np.testing.assert_allclose(costs, costs[0], rtol=0.1)


def test_angles_and_parameters_reach_their_common_optimum() -> None:
    """From J and b that are 50 % too high, another correction of the angles gains nothing."""
    noise = np.array([1e-3, SPEED_NOISE])
    for seed in range(3):
        simulator, values, _ = _slow_run(np.random.default_rng(seed), has_cogging=True)
        coordinates = Coordinates(simulator.model.parameters)
        wrong = [
            v * (1.5 if n in {"J", "b"} else 1.0)
            for n, v in zip(coordinates.names, values, strict=True)
        ]
        start = [initial_states(simulator.model, record) for record in simulator.records]
        begun, states = tracked(simulator, np.array(wrong), start, noise)
        weighting = replace(Weighting.white(begun.records), deviation=noise)
        position = coordinates.of(np.array(wrong))

        fit = solve_tracked(begun, coordinates, position, states, weighting)

        again, states = tracked(fit.simulator, fit.values, fit.states, fit.weighting.deviation)
        weighting = replace(fit.weighting, records=again.records)
        further = solve(again, coordinates, fit.position, states, weighting)
        assert fit.cost - further.cost < 1e-3 * 2 * ROWS


def test_a_drift_in_slow_noise_is_tracked_as_one_that_is_faster() -> None:
    """A correlation of 0.9 between samples makes the angle drift as fast as 4.4 times the noise."""
    noise, memory = np.array([1e-3, SPEED_NOISE]), 0.9
    simulator, values, angle = _slow_run(np.random.default_rng(1), has_cogging=True, memory=memory)
    coordinates = Coordinates(simulator.model.parameters)
    start = [initial_states(simulator.model, record) for record in simulator.records]
    as_white, states = tracked(simulator, values, start, noise)
    weighting = replace(Weighting.white(as_white.records), deviation=noise)

    fit = solve_tracked(as_white, coordinates, coordinates.of(values), states, weighting)

    assert np.isclose(slow_noise(fit), np.sqrt((1 + memory) / (1 - memory)), rtol=0.2)
    assert _phase_errors(fit.simulator, angle) < 0.5 * _phase_errors(as_white, angle)
