"""The state in which a run begins is found from its first samples."""

from __future__ import annotations

import numpy as np
import pytest

from identification.fit.initial import fitted_initial_states
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from tests.motors import Motor, campaign, motor_named, noiseless


@pytest.mark.parametrize("name", ["servo 100 W", "paper", "traction 10 kW"])
def test_a_run_that_begins_in_motion_is_started_in_motion(name: str) -> None:
    """The clean first sample is known; one noisy sample would be off by the noise itself."""
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
    """A clean run from the true motor has one start that fits it."""
    motor = motor_named("servo 100 W")
    runs = noiseless(motor, seed=4, runs=1, moving=True)
    simulator = Simulator.fitting(MotorModel(), records_of(runs), motor.vector)

    (state,) = fitted_initial_states(simulator, motor.vector, np.array([1e-3, 1e-2]))

    np.testing.assert_allclose(state, [runs[0].current[0], runs[0].speed[0]], rtol=1e-3)
