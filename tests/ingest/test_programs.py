"""Exports of programs and loggers: exact times, and messages that say what to type."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification import errors
from identification.ingest import file, read_run
from identification.ingest.read import list_columns
from identification.ingest.several_files import join_files
from identification.ingest.text import samples
from identification.ingest.text.bare import BareCells
from tests.ingest.devices import text
from tests.ingest.loggers import long, stacked
from tests.ingest.programs import EPOCH_NS, epoch
from tests.ingest.samples import record, write
from tests.ingest.writers import RECORD, rows

LONG = long("Time[s];Name;Value;Unit", "{time};{name};{value};{unit}")


@pytest.mark.parametrize(
    ("delimiter", "line", "plain"),
    [
        (" ", "U:-2.5  I:3e-3", "-2.5 3e-3"),
        (";", "U: 2,5;I:3", "2,5;3"),
        (",", "U=2.5, I: 3", "2.5,3"),
    ],
)
def test_lines_like_most_are_not_taken_apart_cell_by_cell(
    monkeypatch: pytest.MonkeyPatch, delimiter: str, line: str, plain: str
) -> None:
    """One pattern for the whole line; cell by cell takes five times as long."""
    bare = BareCells.of(delimiter, ["U:1.5", "I:0.3"])

    def taken_apart(cell: str) -> tuple[str, str, str]:
        raise AssertionError(cell)

    monkeypatch.setattr("identification.ingest.text.bare._parts", taken_apart)

    assert bare.line(line) == plain
    timed = BareCells(delimiter, ("", "", "U"), ("", "", ""), clock=0, part=1, digits=3)
    cells = delimiter.join(["08:00:00", "7", "U:2.5"])
    assert timed.line(cells) == delimiter.join(["08:00:00.007", "7", "2.5"])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#CLOCK=1.00mS", "", "CH1 (40 values, no interval), CH2 (40 values"),
        ("#CLOCK=1.00mS", "#CLOCK=2.00mS", "CH1 (40 values, 0.002 s), CH2 (40 values, 0.001 s)"),
        ("#CHANNEL:CH2", "#CH2", "'#CH2' (40 values, 0.001 s), CH3"),
        ("\n12.", "\nx12.", "CH1 (39 values, 0.001 s), CH2 (40 values"),
        ("\n-12.01", "\nx12.01", "CH1 (17 values, 0.001 s), 'x12.014623' (22 values"),
    ],
)
def test_channels_one_below_another_have_names_and_one_clock(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    """A lost or damaged value would shift all values below it; no value may be left out."""
    path = tmp_path / "run.txt"
    content = stacked("#CHANNEL:{name}", "#CLOCK=1.00mS", "#UNITS:V")
    assert old in content
    path.write_text(content.replace(old, new, 1))

    with pytest.raises(errors.UnsupportedContent) as caught:
        read_run(path)

    assert words in str(caught.value)


def test_channel_of_a_signal_per_row_file_reports_the_line_of_a_fault(tmp_path: Path) -> None:
    """The current of the fourth sample stands on line 15."""
    path = tmp_path / "run.csv"
    lines = LONG.splitlines()
    time, name, _, unit = lines[14].split(";")
    lines[14] = ";".join([time, name, "1e9", unit])
    path.write_text("\n".join([*lines, ""]))

    with pytest.raises(errors.AbsurdValue) as caught:
        read_run(path)

    assert (name, caught.value.column) == ("Current", "Current")
    # The row is that of the voltage, whose clock is used.
    assert caught.value.row == 14


@pytest.mark.parametrize(
    ("form", "unit"),
    [("{whole}{ms}000000", "ns"), ("{whole}.{ms}000000", "s"), ("{whole}{ms}", "ms")],
)
def test_times_since_1970_keep_every_digit(tmp_path: Path, form: str, unit: str) -> None:
    """ROS, PlotJuggler and Grafana; as floating point numbers they would be rounded to 0.24 us."""
    path = tmp_path / "run.csv"
    path.write_text(epoch(form))

    run = read_run(path, mapping={"time_s": {"column": "Time", "unit": unit}})

    np.testing.assert_allclose(run.time - run.time[0], RECORD["time_s"], rtol=0, atol=2e-11)
    # Files of one recording stay aligned.
    assert run.time[0] == pytest.approx(1_772_352_000 % 100_000, abs=1e-9)


@pytest.mark.parametrize(
    ("form", "header"),
    [
        ("{whole}{ms}000000", "timestamp_ns"),
        ("{whole},{ms}000000", "header.stamp.sec,header.stamp.nanosec"),
        ("{whole},{ms}000000", "header.stamp.secs,header.stamp.nsecs"),
    ],
)
def test_times_since_1970_whose_header_gives_their_unit_need_no_mapping(
    tmp_path: Path, form: str, header: str
) -> None:
    """A header of ROS has whole seconds and nanoseconds, in ROS 2 and in ROS 1."""
    path = tmp_path / "run.csv"
    path.write_text(epoch(form).replace("Time", header))

    run = read_run(path)

    np.testing.assert_allclose(run.time - run.time[0], RECORD["time_s"], rtol=0, atol=2e-11)
    assert run.time[0] == pytest.approx(1_772_352_000 % 100_000, abs=1e-9)
    # Both columns are used.
    assert "unused_columns" not in [w.code for w in run.warnings]


def test_offset_of_times_since_1970_is_that_of_the_whole_number(tmp_path: Path) -> None:
    """The user takes away the start."""
    path = tmp_path / "run.csv"
    path.write_text(epoch("{whole}.{ms}"))

    run = read_run(path, mapping={"time_s": {"column": "Time", "offset": -1_772_352_000}})

    np.testing.assert_allclose(run.time, RECORD["time_s"], atol=3e-7)


def test_channels_with_times_since_1970_are_joined(tmp_path: Path) -> None:
    """Speed in a file of its own, from the same clock."""
    lines = epoch("{whole}.{ms}").splitlines()
    for name, at in (("electrical.csv", (0, 1, 2)), ("speed.csv", (0, 3))):
        cut = [",".join(line.split(",")[k] for k in at) for line in lines]
        (tmp_path / name).write_text("\n".join([*cut[: 1 + 40 - len(at)], ""]))

    run = join_files(
        [tmp_path / "electrical.csv", tmp_path / "speed.csv"],
        "run.csv",
        {"time_s": {"column": "Time", "unit": "s"}},
    )

    assert np.array_equal(run.speed, RECORD["speed_rad_s"][: run.rows])


def test_times_of_day_are_not_read_cell_by_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cell by cell, 200,000 lines take twice as long."""
    path = tmp_path / "run.csv"
    lines = [[f"08:00:00.{k:03d}", *row[1:]] for k, row in enumerate(rows())]
    path.write_text(text((",".join(RECORD),), lines))

    def slow(*_: object) -> None:
        raise AssertionError("cell by cell")

    monkeypatch.setattr(samples.SampleReader, "read", slow)

    assert np.array_equal(read_run(path).time, RECORD["time_s"])


def test_decimal_sign_of_the_times_is_not_that_of_the_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points in the times, and whole numbers only in the first of several blocks."""
    monkeypatch.setattr(file, "_CHUNK_BYTES", 600)
    path = tmp_path / "run.csv"
    numbers = [[f"{k}" if k < 30 else f"{k},5"] * 3 for k in range(90)]
    lines = [[f"08:00:00.{k:03d}", *cells] for k, cells in enumerate(numbers)]
    path.write_text(text(("Time;voltage_V;current_A;speed_rpm",), lines, ";"))

    assert read_run(path).current.tolist() == [k if k < 30 else k + 0.5 for k in range(90)]


@pytest.mark.parametrize(
    ("content", "error", "words"),
    [
        (b'{"t": 0.0, "u": 1.0}\n' * 40, errors.NotText, "this is JSON, not a text table"),
        (b"7z\xbc\xaf" + bytes(40), errors.NotText, "unpack it, and give the file"),
        (
            write(record()).replace(b"\n0.02,", b"\n0.0,0.02,", 1),
            errors.RaggedRow,
            "remove a damaged",
        ),
        (
            b"Time / s,Vm:Voltage / mV,Current / A,Speed / rpm\n" + b"0,1,2,3\n" * 9,
            errors.MissingColumn,
            '{"voltage_V": {"column": "Vm:Voltage / mV"}}',
        ),
        (
            b"Time(s),CH1(V),CH2(A),CH3(V)\n" + b"0,1,2,3\n" * 9,
            errors.MissingColumn,
            "time_s is 'Time(s)'; current_A may be 'CH2(A)'; 'CH1(V)', 'CH3(V)' in V have no name",
        ),
        (
            b"time_s,voltage_V,velocity_0,effort_0\n" + b"0,1,2,3\n" * 9,
            errors.MissingColumn,
            "no column for current_A, speed_rad_s; speed_rad_s may be 'velocity_0'",
        ),
        (
            b"time_s,voltage_V,current_A,erpm\n" + b"0,1,2,3\n" * 9,
            errors.MissingColumn,
            '{"column": "erpm", "scale": "TURNS_PER_ELECTRICAL_TURN", "unit": "rpm"}',
        ),
    ],
)
def test_message_says_what_to_do(
    tmp_path: Path, content: bytes, error: type[errors.RunFileError], words: str
) -> None:
    """Content that is not read as it is."""
    path = tmp_path / "run.csv"
    path.write_bytes(content)

    with pytest.raises(error) as caught:
        read_run(path)

    assert words in str(caught.value)


def test_groups_of_twincat_have_their_own_clocks(tmp_path: Path) -> None:
    """Three channels at 1 ms, the temperature at 10 ms from -3 ms on, with decimal commas."""
    head = [
        "Name\tVoltage\tCurrent\tSpeed\tName\tTemperature",
        "SampleTime[ms]\t1\t1\t1\tSampleTime[ms]\t10",
        "Unit\tV (Voltage)\tmA (Current)\trpm (Velocity)\tUnit\t°C (Temperature)",
    ]
    lines = [
        [k, r[1], 1e3 * current, r[3], 10 * k - 3, 20 + k]
        for k, (r, current) in enumerate(zip(rows(), RECORD["current_A"].tolist(), strict=True))
    ]
    path = tmp_path / "run.csv"
    path.write_text(text(head, lines, "\t").replace(".", ","), encoding="utf-8")

    run = read_run(path)

    np.testing.assert_allclose(run.time, RECORD["time_s"], atol=1e-12)
    np.testing.assert_allclose(run.current, RECORD["current_A"], rtol=1e-12)
    assert run.temperature is not None
    np.testing.assert_allclose(run.temperature, 20.3 + np.arange(40) / 10.0, rtol=1e-12)


def test_title_lines_of_gw_instek_are_no_names(tmp_path: Path) -> None:
    """A text in front of a blank cell stands above the times and the volts of one channel."""
    titles = ("Source,CH2,", "Vertical Units,V,", "Horizontal Units,S,", "Firmware,V1.09,")
    path = tmp_path / "run.csv"
    path.write_text(text((*titles, "Time, ,", "Waveform Data,"), [[*r[:2], ""] for r in rows()]))

    found = [(c.title, c.unit and c.unit.name) for c in list_columns(path)]

    assert found == [("time", "s"), ("CH2", "V")]


@pytest.mark.parametrize("unit", ["s", "ms", "us"])
def test_nanoseconds_since_1970_are_read_in_no_coarser_unit(tmp_path: Path, unit: str) -> None:
    """ROS writes them under a name without a unit; the error gives the unit to type."""
    head = "%time,field.header.seq,voltage_V,current_A,speed_rad_s"
    lines = [[EPOCH_NS + k * 10**6, k, *row[1:4]] for k, row in enumerate(rows())]
    path = tmp_path / "run.csv"
    path.write_text(text((head,), lines))

    with pytest.raises(errors.WrongUnit, match="later than the year 5000; expected ns"):
        read_run(path, mapping={"time_s": {"column": "time", "unit": unit}})

    run = read_run(path, mapping={"time_s": {"column": "time", "unit": "ns"}})
    np.testing.assert_allclose(np.diff(run.time), 1e-3, rtol=1e-6)
