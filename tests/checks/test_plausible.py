"""Suspicions of units by the proportions of motors."""

from dataclasses import replace

import numpy as np
import pytest

from identification.checks.campaign import check_runs
from identification.ingest.run import Run
from tests.motors import Motor, campaign, motor_named

SIZES = ["watch 1 W", "coreless 10 W", "servo 100 W", "samarium 400 W", "pump 2 kW"]


def suspects_speed(runs: list[Run]) -> bool:
    """True if the unit of the speed is suspicious."""
    found = [f.column for f in check_runs(runs).findings if f.code == "suspicious_unit"]
    return "speed_rad_s" in found


@pytest.mark.parametrize("name", SIZES)
def test_a_speed_in_rpm_is_suspected_and_the_speed_of_a_motor_that_starts_hard_is_not(
    name: str,
) -> None:
    """The RMS torque, which heats the winding, says how large a rotor is; a start takes more."""
    runs = campaign(motor_named(name), seed=1)
    in_rpm = [replace(run, speed=30.0 / np.pi * run.speed) for run in runs]

    assert not suspects_speed(runs)
    assert suspects_speed(in_rpm)


def test_the_speed_of_a_pager_motor_is_no_suspicion() -> None:
    """A quarter of the torque constant of a watch motor, at 2,400 rad/s and at 4,800 rad/s."""
    runs = campaign(motor_named("watch 1 W"), seed=1)
    for factor in (4.0, 8.0):
        small = [replace(run, speed=factor * run.speed) for run in runs]
        assert max(float(run.speed.max()) for run in small) > 1500.0
        assert not suspects_speed(small)


@pytest.mark.parametrize(
    ("resistance", "constant", "voltage", "rpm"),
    [
        (0.141, 5.9e-3, 12.0, 19_300.0),  # RS-550
        (0.09, 5.3e-3, 18.0, 28_000.0),  # 775pro at 18 V
        (0.08, 2.9e-3, 7.2, 23_400.0),  # 540 of a model car
        (1.7, 2.0e-3, 6.0, 24_000.0),  # RC-260RA
        (0.9, 7e-4, 3.7, 48_000.0),  # coreless motor of 8.5 mm of a drone
    ],
)
def test_the_speed_of_a_motor_of_a_tool_model_or_drone_is_no_suspicion(
    resistance: float, constant: float, voltage: float, rpm: float
) -> None:
    """Its usual speed at its usual voltage is above 1,500 rad/s; read as rpm, it is suspected."""
    inertia = 0.02 * constant**2 / resistance
    friction = 0.02 * constant * voltage / resistance / (rpm * np.pi / 30.0)
    values = (resistance, 0.0039, constant, -0.0012, inertia, friction, 5e-4 * resistance)
    runs = campaign(Motor("fast", values, voltage, 2e-4, 200), seed=1)
    assert max(float(np.abs(run.speed).max()) for run in runs) > 0.6 * rpm * np.pi / 30.0

    assert not suspects_speed(runs)
    assert suspects_speed([replace(run, speed=30.0 / np.pi * run.speed) for run in runs])


def test_a_small_motor_of_a_higher_voltage_is_not_taken_for_one_of_a_tool() -> None:
    """At 48 V and 240 rad/s, read as rpm, it has the size of a 775 and seems to turn at 2,300."""
    values = (2.3, 0.0039, 0.2, -0.0012, 2e-4, 1e-5, 5e-3)
    runs = campaign(Motor("higher voltage", values, 48.0, 1e-3), seed=1)

    assert not suspects_speed(runs)
    assert suspects_speed([replace(run, speed=30.0 / np.pi * run.speed) for run in runs])


def test_the_sentence_on_a_high_speed_leaves_the_unit_open() -> None:
    """Only a surface speed that no rotor endures is said to be too fast."""
    runs = campaign(motor_named("coreless 10 W"), seed=1)
    found = check_runs([replace(run, speed=30.0 / np.pi * run.speed) for run in runs]).findings
    (message,) = (f.message for f in found if f.column == "speed_rad_s")

    assert "few motors of this size reach" in message
    assert "compare Kt = Ke with the data sheet: if the values are in rpm" in message
