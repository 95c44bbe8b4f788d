"""Estimation of the initial state from the first samples of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.electrical import BrushDrop
from identification.fit.initial import fitted_initial_states
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from tests.motors import Motor, campaign, motor_named, noiseless


@pytest.mark.parametrize("name", ["servo 100 W", "paper", "traction 10 kW"])
def test_a_run_that_begins_in_motion_is_started_in_motion(name: str) -> None:
    """Reference: the noise-free first sample; a single noisy sample would err by the noise."""
    motor: Motor = motor_named(name)
    clean = noiseless(motor, seed=3, runs=4, moving=True)
    records = records_of(campaign(motor, seed=3, runs=4, noise=0.05, moving=True))
    noise = 0.05 * np.array(
        [
            np.std(np.concatenate([run.current for run in clean])),
            np.std(np.concatenate([run.speed for run in clean])),
        ]
    )
    simulator = Simulator.fitting(MotorModel(), records, motor.vector)

    states = fitted_initial_states(simulator, motor.vector, noise)

    errors = [
        (state - np.array([run.current[0], run.speed[0]])) / noise
        for state, run in zip(states, clean, strict=True)
    ]
    assert np.sqrt(np.mean(np.square(errors))) < 0.75
    assert np.abs(errors).max() < 2.0


def test_without_noise_the_first_sample_is_the_state() -> None:
    """For a noise-free run of the true motor, the initial state is unique."""
    motor = motor_named("servo 100 W")
    runs = noiseless(motor, seed=4, runs=1, moving=True)
    simulator = Simulator.fitting(MotorModel(), records_of(runs), motor.vector)

    (state,) = fitted_initial_states(simulator, motor.vector, np.array([1e-3, 1e-2]))

    np.testing.assert_allclose(state, [runs[0].current[0], runs[0].speed[0]], rtol=1e-3)


@pytest.mark.parametrize("share", [-0.1, -0.03, 0.02])
def test_a_run_that_begins_with_a_jump_is_started_before_it(share: float) -> None:
    """The current of the first sample decays within one sample interval.

    At the steady state, brushes with a nearly full drop act like a resistance; between it and the
    first sample, the simulation needs smaller steps.
    """
    motor = motor_named("servo 100 W")
    (record,) = records_of(noiseless(motor, seed=4, runs=1, moving=True))
    model = MotorModel((BrushDrop(1.0, 1.0),))
    noise = np.array([3e-4, 1e-3]) * record.span
    drop = [0.3 * record.column("voltage").std(), 0.05 * record.span[0], 2.0, 4.0, 0.0]
    values = np.array([*motor.vector, *drop])
    values[6] = 0.15 * values[0] * record.interval
    start = np.array([share * record.span[0], record.measured[0, 1]])
    exact = Simulator.fitting(model, [record], values).with_tolerance(values, [start], 1e-3 * noise)
    (logged,) = exact.logged(values[:, None], [start])
    assert abs(logged[1, 0, 0] - logged[0, 0, 0]) > 300 * noise[0]

    measured = Simulator.fitting(model, [replace(record, measured=logged[:, :, 0])], values)
    (state,) = fitted_initial_states(measured, values, noise)

    assert np.abs((state - start) / noise).max() < 0.5
