"""Accepted files in the formats of different loggers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.errors import AmbiguousUnit, MissingColumn, NotANumber, NotFinite, WrongUnit
from identification.ingest import file, read_run
from identification.ingest.text import samples
from tests.ingest.layouts import LAYOUTS
from tests.ingest.samples import CANONICAL, Dialect, channels, record, renamed, with_cell, write

Array = NDArray[np.float64]

REAL = Path(__file__).parents[3] / "shared" / "real"

needs_real_data = pytest.mark.skipif(not REAL.is_dir(), reason="the measured runs are not here")


@pytest.mark.parametrize("content", LAYOUTS.values(), ids=[k.replace(" ", "-") for k in LAYOUTS])
def test_record_reads_the_same_in_every_layout(tmp_path: Path, content: bytes) -> None:
    """Reference: the numbers of the record that was written."""
    path = tmp_path / "run.csv"
    path.write_bytes(content)

    run = read_run(path)

    for name, column in record().items():
        assert np.array_equal(channels(run)[name], column), name


HEADERS = {
    "rpm": (
        "speed_rad_s",
        ["speed [rpm]", "Drehzahl (U/min)", "n/min-1", "rpm", "motorSpeedRpm"],
        60.0 / (2.0 * np.pi),
    ),
    "mA": ("current_A", ["current_mA", "Strom (mA)", "i in milliamps", "mA", "I / mA"], 1e3),
    "ms": ("time_s", ["t/ms", "time_ms", "Time [ms]", "elapsed time (msec)"], 1e3),
    "mV": ("voltage_V", ["u_mV", "Voltage, mV", "millivolts", "Spannung [mV]"], 1e3),
}


@pytest.mark.parametrize(
    ("channel", "header", "per_si"),
    [(channel, header, per) for channel, texts, per in HEADERS.values() for header in texts],
)
def test_unit_in_the_header_converts_the_column(
    tmp_path: Path, channel: str, header: str, per_si: float
) -> None:
    """A column in another unit gives the original SI values."""
    path = tmp_path / "run.csv"
    columns = {name if name != channel else header: column for name, column in record().items()}
    columns[header] = columns[header] * per_si
    path.write_bytes(write(columns, Dialect(";")))

    run = channels(read_run(path))

    np.testing.assert_allclose(run[channel], record()[channel], rtol=1e-14)


@pytest.mark.parametrize(
    ("header", "of_celsius"),
    [
        ("temp_degF", lambda celsius: celsius * 9.0 / 5.0 + 32.0),
        ("Motor temperature [°F]", lambda celsius: celsius * 9.0 / 5.0 + 32.0),
        ("T [K]", lambda celsius: celsius + 273.15),
        ("winding temperature in kelvin", lambda celsius: celsius + 273.15),
        ("T/℃", lambda celsius: celsius),
    ],
)
def test_temperature_scales_convert_to_celsius(
    tmp_path: Path, header: str, of_celsius: Callable[[Array], Array]
) -> None:
    """Reference: definitions of the Fahrenheit and Kelvin scales."""
    path = tmp_path / "run.csv"
    columns = record()
    columns[header] = of_celsius(columns.pop("temperature_degC"))
    path.write_bytes(write(columns))

    run = read_run(path)

    assert run.temperature is not None
    np.testing.assert_allclose(run.temperature, record()["temperature_degC"], rtol=1e-12)


def test_hash_is_that_of_the_bytes_on_disk(tmp_path: Path) -> None:
    """Reference: hashlib over a file larger than one block, in another encoding."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record(100_000), Dialect(newline="\r\n", encoding="utf-16")))

    run = read_run(path)

    assert run.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert run.rows == 100_000


def test_name_is_the_one_given_or_else_the_files(tmp_path: Path) -> None:
    """A stored upload has another name on disk; messages use the name given by the user."""
    path = tmp_path / "3f2a"
    path.write_bytes(write(record()))

    assert read_run(path).name == "3f2a"
    assert read_run(path, name="warm run.csv").name == "warm run.csv"
    assert read_run(path, name="a\nb\x1b").name.isprintable()


def test_clean_file_is_read_by_the_fast_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A million rows in two seconds need the fast reader, so the slow one is disabled here."""
    path = tmp_path / "run.csv"

    def slow(*_: object) -> None:
        """Fail the test."""
        pytest.fail("the slow way was taken")

    monkeypatch.setattr(samples.SampleReader, "read", slow)
    for dialect in (Dialect(), Dialect("\t", ","), Dialect(" "), Dialect(";", trailing=True)):
        path.write_bytes(write(record(), dialect))

        assert read_run(path).rows == 40


def test_slow_reader_reads_the_same_numbers_as_the_fast_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the fast reader disabled, the numbers are the same."""
    path = tmp_path / "run.csv"
    for content in LAYOUTS.values():
        path.write_bytes(content)
        fast = channels(read_run(path))
        with monkeypatch.context() as patch:
            patch.setattr(samples, "read_clean", lambda *_: None)
            slow = channels(read_run(path))

        assert all(np.array_equal(fast[name], slow[name]) for name in CANONICAL)


@pytest.mark.parametrize("size", [900, 1201])
def test_blocks_of_any_size_give_the_same_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """Block boundaries fall within characters and line ends; the record is the reference."""
    monkeypatch.setattr(file, "_CHUNK_BYTES", size)
    path = tmp_path / "run.csv"
    for title, content in LAYOUTS.items():
        path.write_bytes(content)

        run = channels(read_run(path))

        for name, column in record().items():
            assert np.array_equal(run[name], column), (title, name)


def test_bad_cell_far_down_is_named_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sample k of a canonical file is on line k + 2, in any block."""
    monkeypatch.setattr(file, "_CHUNK_BYTES", 20_000)
    path = tmp_path / "run.csv"
    path.write_bytes(with_cell("current_A", 4995, "n/a", 5000))

    with pytest.raises(NotFinite, match="row 4997, column current_A: 'n/a' is not a finite"):
        read_run(path)


def test_temperature_logged_more_slowly_is_interpolated_linearly(tmp_path: Path) -> None:
    """Every fourth temperature of a ramp over time is written; the reference is the ramp.

    The sampling instants jitter by 30 % of an interval, so an interpolation over the sample index
    would deviate from the ramp.
    """
    path = tmp_path / "run.csv"
    columns = record(41)
    interval = float(np.diff(columns["time_s"])[0])
    columns["time_s"] = columns["time_s"] + 0.3 * interval * np.sin(np.arange(41.0))
    ramp = 25.0 + 10.0 * columns["time_s"]
    columns["temperature_degC"] = ramp
    lines = write(columns).decode().splitlines()
    for sample in range(41):
        if sample % 4:
            lines[sample + 1] = lines[sample + 1].rsplit(",", 1)[0] + ","
    path.write_text("\n".join(lines) + "\n")

    run = read_run(path)

    assert run.temperature is not None
    np.testing.assert_allclose(run.temperature, ramp, rtol=1e-12)
    assert ("interpolated_temperature", 3) in [(w.code, w.row) for w in run.warnings]


def test_temperature_column_left_blank_is_a_run_without_temperature(tmp_path: Path) -> None:
    """Blank cells give no value to interpolate from."""
    path = tmp_path / "run.csv"
    lines = write(record()).decode().splitlines()
    blank = [lines[0], *(line.rsplit(",", 1)[0] + "," for line in lines[1:])]
    path.write_text("\n".join(blank) + "\n")

    run = read_run(path)

    assert run.temperature is None
    assert "temperatures are blank" in run.warnings[0].message


def test_line_cut_off_by_a_power_failure_is_left_out_with_a_warning(tmp_path: Path) -> None:
    """The file ends in the middle of its last line, line 41."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record())[:-20])

    run = read_run(path)

    assert run.rows == 39
    assert [(w.code, w.row) for w in run.warnings] == [("truncated_last_row", 41)]


@needs_real_data
@pytest.mark.parametrize(("file", "rows"), [("prbs_long.csv", 50_000), ("prbs_short.csv", 10_000)])
def test_measured_servo_reads_with_its_current_sensor_scaled(file: str, rows: int) -> None:
    """The row counts are those of the files; a warning reports the unknown current gain."""
    path = REAL / "labeca_dc_servo" / file
    with pytest.raises(WrongUnit, match=r'"current_A": \{"column": "current_sensor_V", "scale"'):
        read_run(path)

    run = read_run(path, mapping={"current_A": {"column": "current_sensor_V", "scale": 2.5}})

    assert run.rows == rows
    assert sorted(w.code for w in run.warnings) == ["no_temperature", "unknown_gain"]
    assert run.clipped == {}
    assert run.sample_rate_hz == pytest.approx(1.0 / 0.00012)


@needs_real_data
def test_measured_robot_log_is_refused_with_the_missing_channel() -> None:
    """According to its README, the file has no voltage and three motors."""
    path = REAL / "robotino_dunkermotor" / "data_for_identification_with_integral.csv"

    with pytest.raises(MissingColumn, match="no column for voltage_V") as caught:
        read_run(path)

    for title in ("1st motor current", "3rd motor velocity", '"column": "1st motor current"'):
        assert title in str(caught.value)
    assert "set speed'," not in str(caught.value).split("the file has")[0]


def test_a_column_that_may_be_the_temperature_is_named(tmp_path: Path) -> None:
    """Beside a time with a unit, `T` without one may be the temperature."""
    path = tmp_path / "run.csv"
    path.write_bytes(renamed(time_s="t [s]", temperature_degC="T"))

    run = read_run(path)

    assert "no temperature column (it may be 'T')" in run.warnings[0].message


def test_unused_columns_are_named_in_a_warning(tmp_path: Path) -> None:
    """A misspelt optional channel must not be dropped silently."""
    path = tmp_path / "run.csv"
    path.write_bytes(renamed(temperature_degC="temprature_degC"))

    run = read_run(path)

    assert [w.code for w in run.warnings] == ["no_temperature", "unused_columns"]
    assert "temprature_degC" in run.warnings[1].message


def test_name_without_unit_is_never_taken_for_si(tmp_path: Path) -> None:
    """All names are known, but the first column has no unit."""
    path = tmp_path / "run.csv"
    names = ("t", "u", "i", "n", "temp")
    path.write_bytes(write(dict(zip(names, record().values(), strict=True))))

    with pytest.raises(AmbiguousUnit, match="has no unit"):
        read_run(path)


@pytest.mark.parametrize("rows", [2_000, 20_000])
def test_fault_far_down_in_a_long_file_has_its_row(tmp_path: Path, rows: int) -> None:
    """The last line but one of files of 0.1 and 1 MB contains a word."""
    lines = write(record(rows)).decode().split("\n")
    lines[rows - 1] = lines[rows - 1].rsplit(",", 1)[0] + ",warm"
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines))

    with pytest.raises(NotANumber) as caught:
        read_run(path)

    assert caught.value.row == rows
    assert caught.value.column == "temperature_degC"
