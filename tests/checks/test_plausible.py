"""Suspicions of units by the proportions of motors."""

from dataclasses import replace

import numpy as np
import pytest

from identification.checks.campaign import check_runs
from identification.ingest.run import Run
from tests.motors import campaign, motor_named

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
