"""Speeds and currents that overflow the number in which they are logged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.ingest import Run
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")


def of_integer(run: Run, name: str, limit: float, bits: int) -> Run:
    """The run with a channel in an integer of some bits, which wraps at the limit [A, rad/s]."""
    step = limit / 2.0 ** (bits - 1)
    counts = np.round(getattr(run, name) / step).astype(np.int64)
    half = 2 ** (bits - 1)
    return replace(run, **{name: ((counts + half) % (2 * half) - half) * step})


@pytest.mark.parametrize(
    ("name", "column", "bits"), [("speed", "speed_rad_s", 16), ("current", "current_A", 12)]
)
def test_a_channel_that_wraps_is_refused_with_its_range(name: str, column: str, bits: int) -> None:
    """Whole steps give the range exactly, and the mapping continues the values beyond it."""
    runs = campaign(SERVO, seed=2, runs=3)
    limit = 0.6 * max(float(np.abs(getattr(run, name)).max()) for run in runs)
    wrapped = [of_integer(run, name, limit, bits) for run in runs]
    found = check_runs(wrapped).refused

    assert found
    assert {(f.code, f.column) for f in found} == {("wrapped_channel", column)}
    for finding in found:
        period = float(finding.corrections[0].rpartition(" mod ")[2])
        assert period == pytest.approx(2.0 * limit, rel=1e-9)


def test_a_speed_that_reverses_within_a_sample_does_not_wrap() -> None:
    """Its jumps have one size as well, but the voltage balance holds with them."""
    rng = np.random.default_rng(4)
    time = 0.1 * np.arange(2000, dtype=np.float64)
    voltage = 10.0 * np.repeat(rng.choice([-1.0, 1.0], 200), 10)
    speed = voltage / 0.05 + rng.normal(scale=0.2, size=time.size)
    current = 0.5 * np.sign(voltage) + rng.normal(scale=0.01, size=time.size)
    run = Run("run.csv", "0" * 64, time, voltage + current, current, speed, None)

    assert "wrapped_channel" not in {f.code for f in check_runs([run]).findings}


def test_a_sensor_that_fails_at_a_steady_speed_does_not_wrap() -> None:
    """Its jumps have the size of the speed, and the motor does not move on beyond them."""
    rng = np.random.default_rng(5)
    time = 1e-3 * np.arange(4000, dtype=np.float64)
    voltage = np.where(time < 2.0, np.repeat(rng.uniform(0.0, 8.0, 40), 100), 12.0)
    speed = np.zeros(time.size)
    for k in range(time.size - 1):
        speed[k + 1] = speed[k] + 0.05 * (voltage[k] / 0.05 - speed[k])
    current = voltage - 0.05 * speed + rng.normal(scale=0.01, size=time.size)
    failed = (time > 2.5) & (np.arange(time.size) // 10 % 5 == 4)
    speed = np.where(failed, 0.0, speed + rng.normal(scale=0.1, size=time.size))
    run = Run("run.csv", "0" * 64, time, voltage, current, speed, None)

    assert "wrapped_channel" not in {f.code for f in check_runs([run]).findings}
