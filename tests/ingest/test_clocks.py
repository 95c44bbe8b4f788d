"""Channels with clocks of their own: which clock is used, and how the others are brought to it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from identification import errors
from identification.ingest import Run, RunFile, read_run
from identification.ingest.clocks import Signal, SignalTable

Array = NDArray[np.float64]

UNITS = {"voltage": "V", "current": "A", "speed": "rad/s", "temperature": "degC", "dir": ""}


def clock(step: float) -> Array:
    """Times from 0 to 1 s."""
    return np.linspace(0.0, 1.0, round(1.0 / step) + 1, dtype=np.float64)


def counted(time: Array) -> Array:
    """Voltage that differs from sample to sample."""
    return np.asarray(np.arange(time.size) % 7 - 3.0, dtype=np.float64)


FAST, MEDIUM, SLOW = clock(0.01), clock(0.02), clock(0.25)


class Reader:
    """Reader of given signals, whatever the file."""

    def __init__(self, signals: Mapping[str, tuple[Array, Array]]) -> None:
        self._signals = signals

    def recognises(self, name: str, head: bytes) -> bool:
        """Recognise any file."""
        return True

    def open(self, file: RunFile) -> SignalTable:
        """Return the signals, each with a clock of its own."""
        signals = [
            Signal((name,), UNITS[name], partial(np.asarray, time), partial(np.asarray, values))
            for name, (time, values) in self._signals.items()
        ]
        return SignalTable(signals, file.name)


def read(tmp_path: Path, **clocks: Array) -> Run:
    """Run whose channels are straight lines on the given clocks; the voltage counts its samples."""
    lines = {"voltage": 1.0, "current": 2.0, "speed": 30.0, "temperature": 5.0}
    signals = {
        name: (time, counted(time) if name == "voltage" else np.multiply(lines[name], time))
        for name, time in clocks.items()
    }
    path = tmp_path / "run.any"
    path.write_bytes(b"signals")
    return read_run(path, readers=[Reader(signals)])


def test_clock_of_the_voltage_is_used_where_it_is_among_the_fastest(tmp_path: Path) -> None:
    """A straight line interpolated linearly is itself; the voltage stays as logged."""
    run = read(tmp_path, voltage=FAST, current=FAST, speed=MEDIUM, temperature=SLOW)

    assert np.array_equal(run.time, FAST)
    assert np.array_equal(run.voltage, counted(FAST))
    np.testing.assert_allclose(run.speed, 30.0 * FAST, atol=1e-12)
    assert run.temperature is not None
    np.testing.assert_allclose(run.temperature, 5.0 * FAST, atol=1e-12)
    assert {name: source.method for name, source in run.sources.items() if source.method} == {
        "speed_rad_s": "linear",
        "temperature_degC": "linear",
    }


def test_slower_voltage_keeps_its_value_between_its_samples(tmp_path: Path) -> None:
    """Between two samples of the drive's command the terminals see the earlier one."""
    run = read(tmp_path, voltage=MEDIUM, current=FAST, speed=FAST)

    expected = np.repeat(counted(MEDIUM), 2)[: FAST.size]
    assert np.array_equal(run.time, FAST)
    assert np.array_equal(run.voltage, expected)
    assert run.sources["voltage_V"].method == "hold"


def test_warning_states_clock_and_methods(tmp_path: Path) -> None:
    """The intervals are those of the clocks."""
    run = read(tmp_path, voltage=FAST, current=FAST, speed=MEDIUM)

    (warning,) = (w for w in run.warnings if w.code == "different_clocks")
    assert warning.message == (
        "the channels have different clocks; that of voltage (0.01 s) is used: speed (0.02 s) is "
        "interpolated linearly"
    )


def test_nothing_is_extrapolated_and_no_gap_is_bridged(tmp_path: Path) -> None:
    """The speed begins at 0.1 s and has a gap from 0.5 s to 0.7 s; the run has one, too."""
    speed = MEDIUM[(MEDIUM >= 0.1) & ((MEDIUM <= 0.501) | (MEDIUM >= 0.699))]

    run = read(tmp_path, voltage=FAST, current=FAST, speed=speed)

    assert run.time[0] == pytest.approx(0.1)
    inside = (run.time > 0.505) & (run.time < 0.695)
    assert not inside.any()
    assert len(run.segments) == 2


def test_channels_with_equal_clocks_are_not_changed(tmp_path: Path) -> None:
    """Equal times in two arrays are one clock; no warning, no method."""
    run = read(tmp_path, voltage=FAST, current=FAST.copy(), speed=FAST.copy())

    assert not [w for w in run.warnings if w.code == "different_clocks"]
    assert not [source for source in run.sources.values() if source.method]


def test_channel_whose_time_decreases_is_refused_with_its_sample(tmp_path: Path) -> None:
    """The third time of the speed is before the second one."""
    speed = MEDIUM.copy()
    speed[2] = 0.01

    with pytest.raises(errors.BackwardTime, match="row 3, column speed: .* 0.02 s to 0.01 s"):
        read(tmp_path, voltage=FAST, current=FAST, speed=speed)


def test_constant_voltage_has_no_clock(tmp_path: Path) -> None:
    """The clock is then that of the fastest of current and speed."""
    time = {"current": MEDIUM, "speed": FAST}
    signals = {name: (clock, 2.0 * clock) for name, clock in time.items()}
    path = tmp_path / "run.any"
    path.write_bytes(b"signals")

    run = read_run(path, readers=[Reader(signals)], mapping={"voltage_V": {"value": 12.0}})

    assert np.array_equal(run.time, FAST)
    assert np.all(run.voltage == 12.0)


def test_direction_keeps_its_last_value(tmp_path: Path) -> None:
    """A direction between 1 and -1 would be none."""
    direction = np.where(np.arange(SLOW.size) % 2 == 0, 1.0, -1.0)
    signals = {"voltage": (FAST, np.full(FAST.size, 3.0)), "dir": (SLOW, direction)}
    signals |= {name: (FAST, 2.0 * FAST) for name in ("current", "speed")}
    path = tmp_path / "run.any"
    path.write_bytes(b"signals")
    mapping = {"voltage_V": {"column": "voltage", "sign": "dir"}}

    run = read_run(path, readers=[Reader(signals)], mapping=mapping)

    expected = direction[np.searchsorted(SLOW, run.time, side="right") - 1]
    assert np.array_equal(run.voltage, 3.0 * expected)
