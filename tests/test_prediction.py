"""Prediction of a planned run, which has inputs and no readings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from identification.ingest import Run
from identification.prediction import predict
from tests.motors import NAMES, motor_named, simulated

SERVO = motor_named("servo 100 W")
PARAMETERS = {
    name: {"estimate": value} for name, value in zip(NAMES, SERVO.vector.tolist(), strict=True)
}
RESULT: dict[str, Any] = {
    "declared": {"parameters": PARAMETERS},
    "parameters": PARAMETERS,
    "noise": {"current_A": 0.02, "speed_rad_s": 0.02},
}
ROWS = 400


def planned(current: float, speed: float, temperature: float | None) -> Run:
    """Run with 12 V from the first sample on and a constant in place of each reading."""
    return Run(
        name="planned.csv",
        sha256="",
        time=SERVO.interval * np.arange(ROWS, dtype=np.float64),
        voltage=np.full(ROWS, 12.0),
        current=np.full(ROWS, current),
        speed=np.full(ROWS, speed),
        temperature=None if temperature is None else np.full(ROWS, temperature),
    )


@pytest.mark.parametrize(("current", "speed"), [(0.0, 0.0), (1.5, 40.0)])
def test_planned_run_starts_at_its_constant_readings(current: float, speed: float) -> None:
    """Zeros mean standstill; an initial state fitted to them would begin near the final speed."""
    found = predict(RESULT, planned(current, speed, 60.0))

    warm = np.full(ROWS, 60.0)
    start = np.array([current, speed])
    expected = simulated(SERVO.vector, SERVO.interval, np.full(ROWS, 12.0), warm, start)
    assert found[["current_A", "speed_rad_s"]].to_numpy() == pytest.approx(expected, abs=1e-9)


def test_planned_run_without_a_temperature_is_at_25_degrees() -> None:
    """No reading says which temperature the motor will have."""
    unlogged, logged = (predict(RESULT, planned(0.0, 0.0, known)) for known in (None, 25.0))

    assert unlogged.to_numpy() == pytest.approx(logged.to_numpy(), abs=1e-12)
