"""Signs of current and speed: reversed sensors, magnitudes, and motors that only look like them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from identification.checks import check_runs
from identification.ingest import read_run
from tests.ingest.samples import ROWS, motor

Array = NDArray[np.float64]


def contradictions(columns: dict[str, Array]) -> list[tuple[str, str | None]]:
    """Code and column of each finding of a run, all of which refuse it."""
    findings = check_runs([read_run(pd.DataFrame(columns))]).findings
    assert all(finding.severity == "refuse" for finding in findings)
    return [(finding.code, finding.column) for finding in findings]


@pytest.mark.parametrize("channel", ["current_A", "speed_rad_s"])
def test_channel_of_magnitudes_is_reported(channel: str) -> None:
    """The motor reverses, and one channel is its absolute value."""
    columns = motor()
    columns[channel] = np.abs(columns[channel])

    assert contradictions(columns) == [("unsigned_channel", channel)]


def test_an_rms_current_is_among_the_causes_of_a_current_without_sign() -> None:
    """The RMS value is never negative; that of a speed is no usual reading."""
    columns = motor()
    for channel in ("current_A", "speed_rad_s"):
        columns[channel] = np.abs(columns[channel])

    current, speed = check_runs([read_run(pd.DataFrame(columns))]).findings

    assert ("RMS" in current.remedy, "RMS" in speed.remedy) == (True, False)


def test_two_channels_of_magnitudes_are_both_reported() -> None:
    """Current and speed are absolute values."""
    columns = motor()
    for channel in ("current_A", "speed_rad_s"):
        columns[channel] = np.abs(columns[channel])

    assert contradictions(columns) == [
        ("unsigned_channel", "current_A"),
        ("unsigned_channel", "speed_rad_s"),
    ]


@pytest.mark.parametrize(
    "channels",
    [
        ("voltage_V",),
        ("voltage_V", "current_A"),
        ("voltage_V", "current_A", "speed_rad_s"),
    ],
)
@pytest.mark.parametrize("seed", [7, 8])
def test_voltage_of_magnitudes_is_reported(channels: tuple[str, ...], seed: int) -> None:
    """A board logs the duty as a magnitude and the direction in a column of its own.

    A current sensor in the supply lead and a pulse counter lose the sign, too.
    """
    columns = motor(seed=seed)
    for channel in channels:
        columns[channel] = np.abs(columns[channel])

    assert contradictions(columns) == [("unsigned_channel", channel) for channel in channels]


@pytest.mark.parametrize("noise", [0.02, 0.2, 0.5])
@pytest.mark.parametrize("seed", range(4))
def test_motor_of_one_direction_is_no_magnitude(seed: int, noise: float) -> None:
    """Voltage, current and speed are positive, apart from the noise, and the current is coarse."""
    generator = np.random.default_rng(seed)
    columns = motor()
    level = np.repeat(generator.uniform(2.0, 12.0, ROWS // 100), 100)
    speed, drag = np.zeros(ROWS), 0.4
    for k in range(ROWS - 1):
        current = max((level[k] - 0.07 * speed[k]) / 0.6, 0.0)
        speed[k + 1] = max(speed[k] + 1e-3 * (0.07 * current - drag) / 2e-3, 0.0)
    current = np.maximum((level - 0.07 * speed) / 0.6, 0.0)
    measured = current + generator.normal(0.0, noise * np.std(current), ROWS)
    # A diode keeps the current positive: where it blocks, the motor is at its induced voltage.
    columns["voltage_V"] = np.maximum(level, 0.07 * speed)
    columns["current_A"] = np.abs(np.round(measured / 0.05) * 0.05)
    columns["speed_rad_s"] = speed + generator.normal(0.0, 0.1, ROWS)

    assert contradictions(columns) == []


def test_braking_by_reversed_voltage_is_no_unsigned_speed() -> None:
    """300 samples of acceleration, then 100 of braking, too few to reverse the motion."""
    columns = motor(400)
    voltage = np.where(np.arange(400) < 300, 12.0, -3.0)
    speed = np.zeros(400)
    for k in range(399):
        speed[k + 1] = speed[k] + 1e-3 * 0.07 * (voltage[k] - 0.07 * speed[k]) / 0.6 / 2e-3
    columns["voltage_V"] = voltage + np.random.default_rng(1).normal(0.0, 0.02, 400)
    columns["speed_rad_s"] = speed
    columns["current_A"] = (voltage - 0.07 * speed) / 0.6

    assert np.all(speed[1:] > 0.0)
    assert contradictions(columns) == []


def test_current_of_a_hoist_keeps_its_sign_and_is_no_magnitude() -> None:
    """A load of 1.4 N m needs 20 A in both directions, while the voltage follows the speed."""
    columns = motor()
    speed = 300.0 * np.sin(np.arange(ROWS) / 200.0)
    current = 20.0 + 2e-4 * 1500.0 * np.cos(np.arange(ROWS) / 200.0) / 0.07
    noise = np.random.default_rng(4).normal(0.0, 0.02, ROWS)
    columns["speed_rad_s"], columns["current_A"] = speed, current
    columns["voltage_V"] = 0.6 * current + 0.07 * speed + noise

    assert np.all(current > 0.0)
    assert np.min(columns["voltage_V"]) < -5.0
    assert contradictions(columns) == []


@pytest.mark.parametrize("channel", ["current_A", "speed_rad_s"])
def test_reversed_sensor_is_reported(channel: str) -> None:
    """One channel has the opposite sign."""
    columns = motor()
    columns[channel] = -columns[channel]

    assert contradictions(columns) == [("reversed_channel", channel)]
