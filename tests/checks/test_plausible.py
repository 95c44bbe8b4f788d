"""Suspicions of units by the proportions of motors."""

from dataclasses import replace

import numpy as np
import pytest

from identification.checks.campaign import check_runs
from identification.ingest.run import Run
from tests.motors import Motor, campaign, motor_named

SIZES = ["watch 1 W", "coreless 10 W", "servo 100 W", "samarium 400 W", "pump 2 kW"]


def suspects(runs: list[Run], column: str) -> bool:
    """True if the unit of the channel is suspicious."""
    found = [f.column for f in check_runs(runs).findings if f.code == "suspicious_unit"]
    return column in found


@pytest.mark.parametrize("name", SIZES)
def test_a_speed_in_rpm_is_suspected_and_the_speed_of_a_motor_that_starts_hard_is_not(
    name: str,
) -> None:
    """The RMS torque, which heats the winding, says how large a rotor is; a start takes more."""
    runs = campaign(motor_named(name), seed=1)
    in_rpm = [replace(run, speed=30.0 / np.pi * run.speed) for run in runs]

    assert not suspects(runs, "speed_rad_s")
    assert suspects(in_rpm, "speed_rad_s")


def test_a_current_in_ma_is_suspected_and_the_inrush_of_a_large_motor_is_not() -> None:
    """A 2 kW servo motor on a stiff supply draws 15 times its rated current at a reversal."""
    values = (0.8, 0.0039, 0.85, -0.0015, 0.012, 0.002, 6e-3)
    runs = campaign(Motor("servo 2 kW", values, 180.0, 1e-3, 150), seed=1)
    in_ma = [replace(run, current=1e3 * run.current) for run in runs]

    assert not suspects(runs, "current_A")
    assert suspects(in_ma, "current_A")
