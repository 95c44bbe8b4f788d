"""Linear model of the state deviation, compared with the matrix exponential."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from identification.diagnosis.deviation import deviation_of
from identification.fit.declared import fit_declared
from identification.model.excitation import records_of
from identification.model.substeps import evenly
from tests.motors import campaign, motor_named


@pytest.mark.parametrize("name", ["servo 100 W", "paper", "traction 10 kW"])
def test_transition_and_pushes_are_those_of_the_matrix_exponential(name: str) -> None:
    """Reference: exponential of the augmented balances, with held disturbances."""
    motor = motor_named(name)
    fit = fit_declared(records_of(campaign(motor, seed=1, runs=2, rows=400)), "zoh")

    deviation = deviation_of(fit)

    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = fit.values
    record = fit.simulator.records[0]
    heat = 0.5 * (record.column("temperature") + record.column("temperature_next"))[7] - 25.0
    hot_ra, hot_kt = ra * (1 + alpha_ra * heat), kt * (1 + alpha_kt * heat)
    rates = np.zeros((4, 4))
    rates[0] = np.array([-hot_ra, -hot_kt, 1.0, 0.0]) / inductance
    rates[1] = np.array([hot_kt, -friction, 0.0, 1.0]) / inertia
    expected = expm(rates * motor.interval)[:2]
    units = np.concatenate([deviation.noise, deviation.scale])
    found = deviation.pieces[0].entries[7].reshape(4, 2).T * deviation.noise[:, None] / units
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())


def test_the_units_give_a_steady_response_of_about_the_noise() -> None:
    """By construction, the steady-state response to a unit disturbance is 1 (noise units)."""
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=2, rows=400)), "zoh")

    deviation = deviation_of(fit)

    entries = np.median(deviation.pieces[0].entries, axis=0).reshape(4, 2).T
    steady = np.linalg.solve(np.eye(2) - entries[:, :2], entries[:, 2:])
    np.testing.assert_allclose(np.abs(steady).max(axis=0), 1.0, rtol=0.2)


def test_memory_does_not_grow_with_the_substeps() -> None:
    """The matrices of 16 and of 64 substeps are multiplied to those of the sample interval."""
    records = records_of(campaign(motor_named("servo 100 W"), seed=3, runs=2, rows=4000))
    fit = fit_declared(records, "zoh")
    peaks = []
    for count in (16, 64):
        simulator = replace(fit.simulator, substeps=evenly([4000, 4000], count))
        # The inputs of all rows exist for as long as the simulator.
        assert simulator.inputs[0].shape[0] == 4000 * count
        divided = replace(fit, simulator=simulator)
        tracemalloc.start()
        deviation_of(divided)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()

    assert peaks[1] < 1.1 * peaks[0]
