"""Warnings of the reader: type, position, and no warning for valid runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.ingest import Run, read_run
from tests.ingest.samples import ROWS, changed, motor, record, write

Array = NDArray[np.float64]


def read(tmp_path: Path, columns: dict[str, Array]) -> Run:
    """Write columns to a file and read it."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(columns))
    return read_run(path)


def codes(run: Run) -> list[str]:
    """Codes of the warnings in their order."""
    return [warning.code for warning in run.warnings]


def quantised(values: Array, step: float) -> Array:
    """Round values to the resolution of a converter."""
    return np.round(values / step) * step


def test_clean_run_gives_no_warning(tmp_path: Path) -> None:
    """The simulated motor is valid with noise and with quantised channels."""
    columns = motor()
    coarse = {
        **columns,
        "current_A": quantised(columns["current_A"], 0.05),
        "speed_rad_s": quantised(columns["speed_rad_s"], 1.0),
    }

    assert codes(read(tmp_path, columns)) == []
    assert codes(read(tmp_path, coarse)) == []
    assert read(tmp_path, columns).segments == ((0, ROWS),)


def test_run_without_noise_gives_no_warning(tmp_path: Path) -> None:
    """Simulated steps settle smoothly to constant levels, which are not sensor limits."""
    time = np.arange(3000) * 1e-3
    settling = 1.0 - np.exp(-time / 0.05)
    columns = {
        "time_s": time,
        "voltage_V": np.where(time < 0.5, 0.0, 12.0),
        "current_A": np.where(time < 0.5, 0.0, 1.0 + 10.0 * np.exp(-(time - 0.5) / 0.05)),
        "speed_rad_s": 150.0 * np.where(time < 0.5, 0.0, np.roll(settling, 500)),
        "temperature_degC": np.full(3000, 25.0),
    }

    assert codes(read(tmp_path, columns)) == []


def test_missing_temperature_gives_a_warning(tmp_path: Path) -> None:
    """Contract: a file without temperature is a run at one unknown temperature."""
    columns = record()
    del columns["temperature_degC"]

    run = read(tmp_path, columns)

    assert run.temperature is None
    assert codes(run) == ["no_temperature"]


def test_column_in_degrees_may_be_the_missing_temperature(tmp_path: Path) -> None:
    """A name that is not known is never mapped by its unit, but the warning names the column."""
    columns = record()
    columns["T_case [degC]"] = columns.pop("temperature_degC")

    run = read(tmp_path, columns)

    assert codes(run) == ["no_temperature", "unused_columns"]
    assert "no temperature column (it may be 'T_case [degC]')" in run.warnings[0].message


def test_gaps_split_the_run_into_segments(tmp_path: Path) -> None:
    """Samples 1000-1099 and 3000-3009 are missing; lines count from 1 with the header."""
    columns = motor()
    keep = np.r_[0:1000, 1100:3000, 3010:ROWS]

    run = read(tmp_path, {name: column[keep] for name, column in columns.items()})

    assert run.segments == ((0, 1000), (1000, 2900), (2900, 3890))
    assert [(w.code, w.row) for w in run.warnings] == [("gap", 1002)]
    assert "2 gap(s)" in run.warnings[0].message


def test_single_lost_sample_is_irregular_and_no_gap(tmp_path: Path) -> None:
    """One interval of twice the median at sample 500, on line 502."""
    columns = motor()

    run = read(tmp_path, {name: np.delete(column, 500) for name, column in columns.items()})

    assert len(run.segments) == 1
    assert [(w.code, w.row) for w in run.warnings] == [("irregular_sampling", 502)]


def test_jitter_is_reported_with_its_size(tmp_path: Path) -> None:
    """Every second sample is late, so short and long intervals alternate."""
    columns = motor()
    columns["time_s"] = columns["time_s"] + 1e-4 * (np.arange(ROWS) % 2) / 2.0

    run = read(tmp_path, columns)

    assert codes(run) == ["irregular_sampling"]
    assert "vary by" in run.warnings[0].message


def test_worst_interval_behind_a_gap_is_found_at_its_line(tmp_path: Path) -> None:
    """A gap before sample 100, then an interval of three times the median before sample 200."""
    columns = motor(400)
    steps = np.full(399, 1e-3)
    steps[99], steps[199] = 1.0, 3e-3
    columns["time_s"] = np.concatenate(([0.0], np.cumsum(steps)))

    run = read(tmp_path, columns)

    assert [(w.code, w.row) for w in run.warnings] == [("gap", 102), ("irregular_sampling", 202)]


def test_two_sampling_rates_are_irregular_and_no_thousand_gaps(tmp_path: Path) -> None:
    """Half of the intervals are ten times the others: two sampling rates, no lost data."""
    columns = motor()
    steps = np.where(np.arange(ROWS - 1) < 2500, 1e-3, 1e-2)
    columns["time_s"] = np.concatenate(([0.0], np.cumsum(steps)))

    run = read(tmp_path, columns)

    assert run.segments == ((0, ROWS),)
    assert codes(run) == ["irregular_sampling"]


@pytest.mark.parametrize("channel", ["voltage_V", "current_A", "speed_rad_s"])
def test_constant_channel_is_reported(tmp_path: Path, channel: str) -> None:
    """One channel is constant."""
    run = read(tmp_path, {**motor(), channel: np.full(ROWS, 1.25)})

    assert [(w.code, w.column) for w in run.warnings] == [("constant_channel", channel)]


@pytest.mark.parametrize("channel", ["current_A", "speed_rad_s"])
@pytest.mark.parametrize("step", [None, 0.01])
@pytest.mark.parametrize("sides", ["top", "bottom", "both"])
def test_clipped_channel_is_marked_at_exactly_the_clipped_samples(
    tmp_path: Path, channel: str, step: float | None, sides: str
) -> None:
    """The channel is clipped at 60 % of its range; the mask must equal the clipped samples."""
    columns = motor()
    values = columns[channel] if step is None else quantised(columns[channel], step)
    low = 0.6 * values.min() if sides != "top" else -np.inf
    high = 0.6 * values.max() if sides != "bottom" else np.inf
    columns[channel] = np.clip(values, low, high)

    run = read(tmp_path, columns)

    assert list(run.clipped) == [channel]
    cut = columns[channel]
    assert np.array_equal(run.clipped[channel], (cut == low) | (cut == high))
    assert codes(run) == ["clipped_channel"] * (2 if sides == "both" else 1)
    first = int(np.argmax(cut == (high if sides != "bottom" else low)))
    assert run.warnings[0].row == first + 2


def test_clipped_channel_without_noise_is_detected_by_its_slope(tmp_path: Path) -> None:
    """A clipped sine reaches the limit with full slope; the maximum of a sine has slope zero."""
    columns = motor()
    sine = 10.0 * np.sin(np.arange(ROWS) / 100.0) + 1.0

    whole = read(tmp_path, {**columns, "current_A": sine})
    cut = read(tmp_path, {**columns, "current_A": np.minimum(sine, 6.0)})

    assert "clipped_channel" not in codes(whole)
    assert np.array_equal(cut.clipped["current_A"], sine >= 6.0)


def test_steady_speed_of_a_coarse_encoder_is_not_clipped(tmp_path: Path) -> None:
    """After a step of the voltage, the last of the counts is that of the steady speed."""
    columns = motor()
    time = np.maximum(np.arange(ROWS) - 50, 0) * 1e-3
    angle = 13 * np.pi / 88e-3 * (time - 0.03 * (1.0 - np.exp(-time / 0.03)))
    counts = np.floor(angle / (2.0 * np.pi / 44))
    speed = (counts[4:] - counts[:-4]) * 2.0 * np.pi / 44 / 4e-3
    columns["speed_rad_s"] = np.concatenate([np.zeros(4), speed])
    columns = {name: values[:400] for name, values in columns.items()}

    assert "clipped_channel" not in codes(read(tmp_path, columns))


def test_noisy_voltage_at_its_limit_is_clipped(tmp_path: Path) -> None:
    """Noise of 0.02 V except at the limit of 9 V."""
    columns = motor()
    columns["voltage_V"] = np.minimum(columns["voltage_V"], 9.0)

    run = read(tmp_path, columns)

    assert np.array_equal(run.clipped["voltage_V"], columns["voltage_V"] == 9.0)


def test_commanded_trapezoid_and_motor_at_rest_are_not_clipped(tmp_path: Path) -> None:
    """A commanded voltage is constant on its plateau, and an encoder reads zero at rest."""
    columns = motor()
    ramp = np.clip(np.abs(np.arange(ROWS) - 2000) / 100.0, 2.0, 12.0) - 2.0
    columns["voltage_V"] = ramp
    columns["speed_rad_s"] = np.where(
        np.arange(ROWS) < 800, 0.0, np.abs(columns["speed_rad_s"]) + 5.0
    )

    run = read(tmp_path, columns)

    assert run.clipped == {}


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("voltage_V", 150.0, "is it in millivolts"),
        ("voltage_V", 1e-3, "is it in kilovolts"),
        ("current_A", 500.0, "is it in milliamperes"),
        ("current_A", 1e-6, "is it in kiloamperes"),
        ("speed_rad_s", 40.0, "is it in rpm"),
        ("speed_rad_s", 1e-6, "is it in krad/s"),
        ("time_s", 1e3, "check the unit of the time"),
    ],
)
def test_unusual_values_give_a_warning_and_are_not_refused(
    tmp_path: Path, channel: str, factor: float, words: str
) -> None:
    """One channel is scaled to the limit of plausible motors."""
    columns = motor()
    columns[channel] = columns[channel] * factor

    run = read(tmp_path, columns)

    assert [(w.code, w.column) for w in run.warnings] == [("suspicious_value", channel)]
    assert words in run.warnings[0].message


def test_same_numbers_in_two_channels_are_reported(tmp_path: Path) -> None:
    """The speed is exported in place of the current."""
    columns = motor()
    columns["current_A"] = columns["speed_rad_s"]

    assert "identical_channels" in codes(read(tmp_path, columns))


def test_position_of_a_geared_sensor_is_reported(tmp_path: Path) -> None:
    """The position is a quarter of the integrated speed; a wrapped angle causes no warning."""
    columns = motor()
    angle = np.concatenate(([0.0], np.cumsum(columns["speed_rad_s"][:-1] * 1e-3)))

    wrapped = read(tmp_path, {**columns, "position_rad": np.mod(angle, 2.0 * np.pi)})
    geared = read(tmp_path, {**columns, "position_rad": angle / 4.0})

    assert codes(wrapped) == []
    assert codes(geared) == ["position_disagrees"]
    assert "0.25 times" in geared.warnings[0].message


def test_a_warning_in_words_names_file_and_column(tmp_path: Path) -> None:
    """The speed sensor is dead; its column is n [rad/s]."""
    columns = motor()
    columns["n [rad/s]"] = 0.0 * columns.pop("speed_rad_s")
    path = tmp_path / "run.csv"
    path.write_bytes(write(columns))

    [warning] = read_run(path, mapping={"speed_rad_s": {"column": "n [rad/s]"}}).warnings

    assert str(warning).startswith("run.csv, column n [rad/s]: is constant")


def test_a_warning_about_a_whole_file_names_no_column(tmp_path: Path) -> None:
    """The temperature is missing."""
    columns = motor()
    del columns["temperature_degC"]

    [warning] = read(tmp_path, columns).warnings

    assert str(warning) == f"run.csv: {warning.message}"


def test_warnings_are_one_printable_line(tmp_path: Path) -> None:
    """A header with control characters is escaped in the warning."""
    path = tmp_path / "run.csv"
    path.write_bytes(changed().replace(b"temperature_degC", b"\x1b[31mx"))

    warning = read_run(path).warnings[-1]

    assert warning.message.isprintable()
    assert warning.file == "run.csv"
