"""Groups of columns side by side, each behind its own time column, as catman and DIAdem write."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from numpy.typing import NDArray

from identification import errors
from identification.ingest import read_run
from tests.ingest.samples import record

RECORD = record(60)
TIME, SPEED = RECORD["time_s"], RECORD["speed_rad_s"]
SPEED_BETWEEN = np.interp(TIME[:-1], TIME[::2], SPEED[::2])
"""Speed of every second time at all times that it covers."""


def beside(
    name: str, channel: str, step: int, *, scale: float = 1.0, shift: float = 0.0
) -> pd.DataFrame:
    """The record with one channel at the end, at every `step`-th time, behind a time column."""
    frame = pd.DataFrame(RECORD).drop(columns=channel)
    frame[name] = pd.Series((TIME[::step] + shift) * scale)
    frame[channel] = pd.Series(RECORD[channel][::step])
    return frame


def codes(path: Path) -> set[str]:
    """Codes of the warnings of a run."""
    return {warning.code for warning in read_run(path).warnings}


def test_channel_has_the_times_of_the_column_to_its_left(tmp_path: Path) -> None:
    """A speed at half the rate is interpolated between its own times, and that is said."""
    path = tmp_path / "run.csv"
    beside("Time 2 [s]", "speed_rad_s", 2).to_csv(path, index=False)

    run = read_run(path)

    assert np.allclose(run.speed, SPEED_BETWEEN, rtol=1e-12)
    assert np.array_equal(run.current, RECORD["current_A"][:-1])
    assert run.sources["speed_rad_s"].method == "linear"
    assert "different_clocks" in codes(path)


@pytest.mark.parametrize("step", [4, 10])
def test_temperature_of_a_slow_group_belongs_to_its_own_times(tmp_path: Path, step: int) -> None:
    """Six or fifteen temperatures stand in the first rows, and cover the whole record."""
    path = tmp_path / "run.csv"
    beside("Time 2 [s]", "temperature_degC", step).to_csv(path, index=False)

    run = read_run(path)

    expected = np.interp(TIME, TIME[::step], RECORD["temperature_degC"][::step])
    assert run.temperature == pytest.approx(expected)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3)])
def test_groups_of_one_clock_are_a_plain_table(tmp_path: Path, unit: str, scale: float) -> None:
    """A time column in front of each channel, all with the same title or in another unit."""
    path, columns = tmp_path / "run.csv", dict[str, NDArray[np.float64]]()
    names = [name for name in RECORD if name != "time_s"]
    for k, name in enumerate(names):
        columns["Time [s]" + k * " "] = TIME if k == 0 else TIME * scale
        columns[name] = RECORD[name]
    frame = pd.DataFrame(columns)
    header = [c for k, name in enumerate(names) for c in (f"Time [{unit if k else 's'}]", name)]
    frame.to_csv(path, index=False, header=header)

    run = read_run(path)

    for name in names:
        assert np.array_equal(run.channels[name], RECORD[name])
    assert np.array_equal(run.time, TIME)
    assert "different_clocks" not in codes(path)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("Time [ms]", "Time [ms].1"),
        ("time_1_ms", "time_2_ms"),
        ("Time 1kHz [ms]", "Time 500Hz [ms]"),
        ("t1/ms", "t2/ms"),
        ("Time 1 [ms]", "Time 2"),
        ("Voltage time [ms]", "Speed time [ms]"),
        ("Time (ms) - drive", "Time (ms) - encoder"),
    ],
)
def test_titles_of_times_differ_in_number_rate_and_channel(
    tmp_path: Path, first: str, second: str
) -> None:
    """As pandas, catman, DIAdem and plots write them; a time without a unit has that of the first.

    The speed has half the rate.
    """
    path = tmp_path / "run.csv"
    frame = beside(second, "speed_rad_s", 2, scale=1e3)
    frame["time_s"] *= 1e3
    frame.rename(columns={"time_s": first}).to_csv(path, index=False)

    assert np.allclose(read_run(path).speed, SPEED_BETWEEN, rtol=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "entry"),
    [
        ("Time", "Time [ms]", {"unit": "ms"}),
        ("Time (1)", "Time (2)", {"unit": "ms"}),
        ("X_Value", "X_Value", {"unit": "ms"}),
        ("Time 1 [h]", "Time 2 [h]", {"scale": 1e-3}),
        ("Sample", "Sample", {"scale": 1e-3}),
    ],
)
def test_mapping_of_the_first_time_serves_all_groups(
    tmp_path: Path, first: str, second: str, entry: dict[str, object]
) -> None:
    """Times without a unit, and counters; one of the groups may state its unit."""
    path = tmp_path / "run.csv"
    frame = beside("second", "speed_rad_s", 2, scale=1e3)
    frame["time_s"] *= 1e3
    names = {"time_s": first, "second": second}
    frame.to_csv(path, index=False, header=[names.get(str(name), str(name)) for name in frame])

    with pytest.raises(errors.RunFileError, match=re.escape(first)):
        read_run(path)
    run = read_run(path, mapping={"time_s": {"column": first, **entry}})

    assert np.allclose(run.speed, SPEED_BETWEEN, rtol=1e-12)


START = pd.Timestamp("2026-03-01 23:59:59.97")


@pytest.mark.parametrize(
    ("form", "ending"),
    [
        *((form, "csv") for form in ("%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%s.%f", "dates")),
        *(("dates", ending) for ending in ("xlsx", "parquet", "frame")),
    ],
)
def test_clocks_of_all_groups_have_one_zero(tmp_path: Path, form: str, ending: str) -> None:
    """The speed starts 40 ms later, after midnight."""
    frame, kept = beside("Time 2", "speed_rad_s", 1), slice(40, None)
    dates = pd.Series(START + pd.to_timedelta(np.round(TIME * 1e6), unit="us"))
    cells = dates if form == "dates" else dates.dt.strftime(form)
    frame = frame.rename(columns={"time_s": "Time 1"}).astype({"Time 1": object, "Time 2": object})
    unit = " [s]" if form == "%s.%f" else ""
    frame["Time 1"] = cells
    for name, values in (("Time 2", cells), ("speed_rad_s", pd.Series(SPEED))):
        frame[name] = values[kept].reset_index(drop=True)
    frame = frame.rename(columns={"Time 1": f"Time 1{unit}", "Time 2": f"Time 2{unit}"})
    path = tmp_path / f"run.{ending}"
    if ending == "csv":
        frame.to_csv(path, index=False)
    elif ending == "xlsx":
        frame.to_excel(path, index=False)
    elif ending == "parquet":
        frame.to_parquet(path)

    run = read_run(frame if ending == "frame" else path)

    assert run.time - run.time[0] == pytest.approx(TIME[kept] - TIME[40], abs=1e-9)
    assert run.speed == pytest.approx(SPEED[kept])
    assert run.current == pytest.approx(RECORD["current_A"][kept])


def test_voltage_in_ms_steps_at_the_sample_of_its_step(tmp_path: Path) -> None:
    """Current and speed twice as fast, in s; a time in ms differs from the same one in s by 1e-17.

    The voltage changes at each of its samples.
    """
    path, ticks = tmp_path / "run.csv", np.arange(600)
    signals = {name: np.sin(0.01 * ticks) for name in ("current_A", "speed_rad_s")}
    slow = {"Time 2 [ms]": 10.0 * ticks[:300], "voltage_V": (-1.0) ** ticks[:300]}
    frame = pd.DataFrame({"Time 1 [s]": np.round(0.005 * ticks, 3), **signals})
    frame.join(pd.DataFrame(slow)).to_csv(path, index=False)

    voltage = read_run(path).voltage
    assert np.array_equal(voltage, np.repeat(slow["voltage_V"], 2)[: voltage.size])


def test_variables_of_different_length_are_groups(tmp_path: Path) -> None:
    """A struct of MATLAB with the times in front of their channels."""
    path = tmp_path / "run.mat"
    frame = beside("time2_s", "speed_rad_s", 2)
    scipy.io.savemat(path, {"log": {name: frame[name].dropna().to_numpy() for name in frame}})

    assert np.allclose(read_run(path).speed, SPEED_BETWEEN, rtol=1e-12)


def test_shorter_group_with_an_unknown_time_is_refused(tmp_path: Path) -> None:
    """Its rows are not those of the voltage."""
    path = tmp_path / "run.csv"
    beside("abscissa", "speed_rad_s", 2).to_csv(path, index=False)

    with pytest.raises(errors.MissingValue, match="only the first 30 of 60 rows have a value"):
        read_run(path)


def test_unit_of_a_second_time_is_checked(tmp_path: Path) -> None:
    """Hours are no unit of a run file."""
    path = tmp_path / "run.csv"
    beside("Time 2 [h]", "speed_rad_s", 2).to_csv(path, index=False)

    with pytest.raises(errors.UnknownUnit, match="the unit 'h' is unknown"):
        read_run(path)


def test_numbered_channels_are_no_groups(tmp_path: Path) -> None:
    """The channels of an oscilloscope with a mathematical one between them, without times."""
    path = tmp_path / "run.csv"
    names = ["CH1", "MATH1", "CH2", "MATH2", "CH3", "MATH3"]
    cells = [c for name in ("voltage_V", "current_A", "speed_rad_s") for c in [RECORD[name]] * 2]
    pd.DataFrame(dict(zip(names, cells, strict=True))).to_csv(path, index=False)
    mapping: dict[str, object] = {
        "time_s": {"column": "row", "scale": 1e-3},
        "voltage_V": {"column": "CH1"},
        "current_A": {"column": "CH2"},
        "speed_rad_s": {"column": "CH3", "unit": "rad/s"},
    }

    assert np.array_equal(read_run(path, mapping=mapping).speed, SPEED)


def test_clocks_of_different_kinds_have_no_time_in_common(tmp_path: Path) -> None:
    """Times of day in the first group, seconds since 1970 in the second."""
    path = tmp_path / "run.csv"
    frame = beside("Time 2 [s]", "speed_rad_s", 1, shift=1_772_352_000.0)
    frame["time_s"] = [f"08:00:{t:06.3f}" for t in TIME]
    frame.rename(columns={"time_s": "Time 1"}).to_csv(path, index=False)

    with pytest.raises(errors.NoRows, match="no time in common"):
        read_run(path)


def test_symbols_of_time_and_temperature_are_no_groups(tmp_path: Path) -> None:
    """Only their case differs."""
    path = tmp_path / "run.csv"
    names = ["time_s", "voltage_V", "current_A", "temperature_degC", "speed_rad_s"]
    symbols, units = "tUITn", ("s", "V", "A", "degC", "rad/s")
    pd.DataFrame(RECORD)[names].to_csv(path, index=False, header=[*symbols])
    mapping = {
        name: {"column": symbol, "unit": unit}
        for name, symbol, unit in zip(names, symbols, units, strict=True)
    }

    assert np.array_equal(read_run(path, mapping=mapping).speed, SPEED)


def test_first_column_is_a_time_if_its_unit_is_one(tmp_path: Path) -> None:
    """The title of catman names the rate: Time 1 - fast."""
    path = tmp_path / "run.csv"
    frame = beside("Time 2 - slow [ms]", "temperature_degC", 10, scale=1e3)
    frame.rename(columns={"time_s": "Time 1 - fast [s]"}).to_csv(path, index=False)

    run = read_run(path)

    expected = np.interp(TIME, TIME[::10], RECORD["temperature_degC"][::10])
    assert run.temperature == pytest.approx(expected)
    assert np.array_equal(run.time, TIME)


@pytest.mark.parametrize("title", ["Time  1 - default sample rate [s]", "time_1_s", "Time 0 (s)"])
def test_numbered_time_of_a_single_group_is_the_time(tmp_path: Path, title: str) -> None:
    """Catman numbers the time also where all channels have one rate."""
    path = tmp_path / "run.csv"
    pd.DataFrame(RECORD).rename(columns={"time_s": title}).to_csv(path, index=False)

    assert np.array_equal(read_run(path).time, TIME)


@pytest.mark.parametrize("lost", ["speed_rad_s", "Time 2 [s]"])
def test_value_or_time_lost_within_a_group_is_refused(tmp_path: Path, lost: str) -> None:
    """The sixth cell is blank; blanks are allowed below the last time of the group only."""
    path = tmp_path / "run.csv"
    frame = beside("Time 2 [s]", "speed_rad_s", 2)
    frame.loc[5, lost] = np.nan
    frame.to_csv(path, index=False)

    with pytest.raises(errors.MissingValue, match="the cell is blank") as caught:
        read_run(path)

    assert (caught.value.row, caught.value.column) == (7, lost)


def test_times_of_a_group_increase(tmp_path: Path) -> None:
    """The fourth time of the speed repeats the third."""
    path = tmp_path / "run.csv"
    frame = beside("Time 2 [s]", "speed_rad_s", 2)
    frame["Time 2 [s]"] = frame["Time 2 [s]"].where(frame.index != 3, TIME[4])
    frame.to_csv(path, index=False)

    with pytest.raises(errors.BackwardTime, match="row 5, column speed_rad_s"):
        read_run(path)


@pytest.mark.parametrize("name", ["Controller time [s]", "Time of day [s]"])
def test_time_with_another_zero_is_no_clock_of_a_group(tmp_path: Path, name: str) -> None:
    """A controller counts from its own start, a clock from midnight."""
    path = tmp_path / "run.csv"
    beside(name, "speed_rad_s", 1, shift=0.02).to_csv(path, index=False)

    assert np.array_equal(read_run(path).speed, SPEED)


def test_time_of_day_beside_the_time_is_not_used(tmp_path: Path) -> None:
    """Its cells are no numbers."""
    path, frame = tmp_path / "run.csv", pd.DataFrame(RECORD)
    frame.insert(4, "Time of day", [f"12:30:{t:06.3f}" for t in TIME])
    frame.to_csv(path, index=False)

    assert read_run(path).temperature == pytest.approx(RECORD["temperature_degC"])


@pytest.mark.parametrize("channel", ["speed_rad_s", "temperature_degC"])
def test_groups_without_a_common_time_are_refused(tmp_path: Path, channel: str) -> None:
    """The second group was recorded an hour later."""
    path = tmp_path / "run.csv"
    beside("Time 2 [s]", channel, 2, shift=3600.0).to_csv(path, index=False)

    with pytest.raises(errors.NoRows, match="no time in common"):
        read_run(path)


def test_sheet_and_frame_are_read_like_text(tmp_path: Path) -> None:
    """The same two rates in a workbook and in a DataFrame."""
    frame, path = beside("Time 2 [s]", "speed_rad_s", 2), tmp_path / "run.xlsx"
    frame.to_excel(path, index=False)

    for source in (path, frame):
        assert np.allclose(read_run(source).speed, SPEED_BETWEEN, rtol=1e-12)


def test_groups_without_any_time_are_refused(tmp_path: Path) -> None:
    """Both time columns are blank."""
    path = tmp_path / "run.csv"
    frame = beside("Time 2 [s]", "speed_rad_s", 2)
    frame[["time_s", "Time 2 [s]"]] = np.nan
    frame.to_csv(path, index=False)

    with pytest.raises(errors.MissingValue, match="row 2, column time_s: the cell is blank"):
        read_run(path)
