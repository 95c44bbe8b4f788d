"""Speeds that were computed from the voltage and the current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.ingest import Run
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")


@pytest.mark.parametrize("digits", [9, 16])
def test_a_computed_speed_is_refused_with_the_values_behind_it(digits: int) -> None:
    """The resistance is 10 % below that of the motor and the constant 4 % above, as assumed."""
    resistance, constant = 0.9 * SERVO.vector[0], 1.04 * SERVO.vector[2]
    runs = []
    for run in campaign(SERVO, seed=2, runs=2):
        speed = (run.voltage - resistance * run.current) / constant
        runs.append(replace(run, speed=np.array([float(f"{w:.{digits}g}") for w in speed])))
    found = check_runs(runs).refused

    assert [(f.code, f.file) for f in found] == [("computed_channel", run.name) for run in runs]
    assert f"R = {resistance:.5g} ohm and K = {constant:.5g}" in found[0].message


def test_a_measured_speed_is_not_computed() -> None:
    """Its residual is the noise of the sensors and the voltage of the inductance."""
    assert check_runs(campaign(SERVO, seed=3, runs=2)).findings == ()


def test_a_simulation_without_noise_and_inductance_is_not_refused() -> None:
    """It obeys the balance to the last digits, with the values of its motor."""
    time = 1e-3 * np.arange(3000, dtype=np.float64)
    speed = 100.0 * np.sin(3.0 * time) + 40.0 * np.sin(7.0 * time)
    current = np.gradient(speed, time) * 1e-3 + 0.1 * np.sign(speed)
    run = Run("run.csv", "0" * 64, time, 2.0 * current + 0.05 * speed, current, speed, None)

    assert "computed_channel" not in {f.code for f in check_runs([run]).findings}
