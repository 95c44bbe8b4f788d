"""Tables with a row for each message of a bus: a channel has a value where its message arrived."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identification import errors
from identification.ingest import read_run
from identification.ingest.several_files import join_files
from tests.ingest.samples import record

RECORD = record(60)
HEADER = ("Time[s]", "Motor::Voltage[V]", "Current[A]", "Motor::Speed[rad/s]", "Case::State")
DRIVE = [{1: v, 2: i} for v, i in zip(RECORD["voltage_V"], RECORD["current_A"], strict=True)]


def messages(*, is_slow: bool = True) -> list[tuple[float, dict[int, object]]]:
    """Times in ms and cells by column: a state first, drive every 1 ms, speed every 2 ms."""
    found: list[tuple[float, dict[int, object]]] = [(-1.0, {4: "Active"})]
    for k, (drive, speed) in enumerate(zip(DRIVE, RECORD["speed_rad_s"], strict=True)):
        found.append((float(k), dict(drive)))
        if k % 2 == 0 or not is_slow:
            found.append((k + 0.5, {3: speed}))
        if k % 20 == 0:
            found.append((k + 0.7, {4: "Active"}))
    return found


def table(rows: Sequence[tuple[float, Mapping[int, object]]]) -> str:
    """Semicolons and decimal commas; a cell is blank where its message has not arrived."""
    lines = [";".join(HEADER)]
    for time, cells in rows:
        line = ";".join([f"{time / 1e3:.4f}", *(str(cells.get(k, "")) for k in range(1, 5))])
        lines.append(line.replace(".", ","))
    return "\n".join([*lines, ""])


def test_channels_of_a_bus_have_the_times_of_their_messages(tmp_path: Path) -> None:
    """The drive stays as logged, and the speed is interpolated; nothing before its first value."""
    path = tmp_path / "bus.csv"
    path.write_text(table(messages()))

    run = read_run(path)

    within = slice(1, 59)
    assert np.array_equal(run.voltage, RECORD["voltage_V"][within])
    assert np.array_equal(run.current, RECORD["current_A"][within])
    at = np.arange(60)[within] - 0.5
    speed = np.interp(at, np.arange(0, 60, 2), RECORD["speed_rad_s"][::2])
    np.testing.assert_allclose(run.speed, speed, rtol=1e-12)
    assert run.sources["speed_rad_s"].method == "linear"
    (note,) = [w.message for w in run.warnings if w.code == "different_clocks"]
    assert "that of Motor::Voltage[V] (0.001 s) is used: Motor::Speed[rad/s] (0.002 s)" in note
    assert "2 sample(s) at which a channel has a gap or no value are omitted" in note


def test_gap_in_one_message_is_not_bridged(tmp_path: Path) -> None:
    """The speed is not sent for 20 ms; the drive has no sample there."""
    path = tmp_path / "bus.csv"
    path.write_text(table([(t, c) for t, c in messages() if 3 not in c or not 20 < t < 40]))

    run = read_run(path)

    assert not np.any((run.time > 0.0205) & (run.time < 0.0395))
    assert len(run.segments) == 2


def test_frame_with_missing_numbers_is_read_as_the_file(tmp_path: Path) -> None:
    """The same messages in a DataFrame, without the states."""
    path = tmp_path / "bus.csv"
    path.write_text(table(messages()))
    rows = [[time / 1e3, *(cells.get(k, np.nan) for k in (1, 2, 3))] for time, cells in messages()]
    frame = pd.DataFrame(rows, columns=list(HEADER[:4])).astype(float)

    run = read_run(frame)

    for name, values in read_run(path).channels.items():
        assert np.array_equal(run.channels[name], values)


def test_signals_of_a_bus_are_joined_with_those_of_another_file(tmp_path: Path) -> None:
    """Speed in a file of its own, at the times of the drive."""
    drive, speed = tmp_path / "drive.csv", tmp_path / "speed.csv"
    drive.write_text(
        table(
            [(t, {k: x for k, x in c.items() if k != 3}) for t, c in messages(is_slow=False)]
        ).replace(";Motor::Speed[rad/s]", ";Temp[degC]")
    )
    pd.DataFrame({"time_s": RECORD["time_s"], "speed_rad_s": RECORD["speed_rad_s"]}).to_csv(
        speed, index=False
    )

    run = join_files([drive, speed], "run.csv", {"temperature_degC": None})

    for name in ("voltage_V", "current_A", "speed_rad_s"):
        assert np.array_equal(run.channels[name], RECORD[name])


def test_fault_of_a_channel_has_its_line(tmp_path: Path) -> None:
    """The message of the drive at 30 ms is on line 50 of the file."""
    path = tmp_path / "bus.csv"
    rows = [(t, {**c, 2: 1e6} if t == 30.0 else c) for t, c in messages()]
    path.write_text(table(rows))

    with pytest.raises(errors.AbsurdValue) as caught:
        read_run(path)

    assert path.read_text().splitlines()[(caught.value.row or 0) - 1].startswith("0,0300;")


@pytest.mark.parametrize("lost", [1, 15])
def test_values_lost_in_a_table_of_one_clock_are_refused(tmp_path: Path, lost: int) -> None:
    """A quarter of the currents is blank; no other channel explains it."""
    path = tmp_path / "run.csv"
    frame = pd.DataFrame(RECORD)
    frame.loc[10 : 9 + lost, "current_A"] = np.nan
    frame.to_csv(path, index=False)

    with pytest.raises(errors.MissingValue, match="row 12, column current_A: the cell is blank"):
        read_run(path)


def test_channel_beside_the_time_of_another_device_is_not_put_on_that_of_the_voltage(
    tmp_path: Path,
) -> None:
    """The speed has half as many samples, and the times of its controller."""
    path = tmp_path / "run.csv"
    frame = pd.DataFrame(RECORD).drop(columns="speed_rad_s")
    frame["Controller time [s]"] = pd.Series(RECORD["time_s"][::2])
    frame["speed_rad_s"] = pd.Series(RECORD["speed_rad_s"][::2])
    frame.to_csv(path, index=False)

    with pytest.raises(errors.MissingValue, match="row 32, column speed_rad_s: only the first 30"):
        read_run(path)


def test_temperature_beside_the_time_of_another_device_is_refused(tmp_path: Path) -> None:
    """Six temperatures at every tenth time stand in the first six rows."""
    path = tmp_path / "run.csv"
    frame = pd.DataFrame(RECORD).drop(columns="temperature_degC")
    frame["Thermometer time [s]"] = pd.Series(RECORD["time_s"][::10])
    frame["temperature_degC"] = pd.Series(RECORD["temperature_degC"][::10])
    frame.to_csv(path, index=False)

    with pytest.raises(errors.MissingValue) as caught:
        read_run(path)

    assert "row 8, column temperature_degC: only the first 6 of 60 rows have a value" in str(
        caught.value
    )
    assert read_run(path, mapping={"temperature_degC": None}).temperature is None


def test_blank_cells_are_reported_with_the_other_faults(tmp_path: Path) -> None:
    """A blank current on line 12 and a word in place of a speed on line 22."""
    path = tmp_path / "run.csv"
    frame = pd.DataFrame(RECORD).astype(object)
    frame.loc[10, "current_A"] = np.nan
    frame.loc[20, "speed_rad_s"] = "fault"
    frame.to_csv(path, index=False)

    with pytest.raises(errors.RunFileError) as caught:
        read_run(path)

    assert "row 12, column current_A: the cell is blank" in str(caught.value)
    assert "row 22, column speed_rad_s: 'fault' is not a number" in str(caught.value)
