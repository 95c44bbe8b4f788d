"""Refused files: each with its own error class, row and column, on one line."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import errors
from identification.ingest import Limits, read_run
from tests.ingest.broken_tables import BROKEN_TABLES, Refusal
from tests.ingest.broken_values import BROKEN_VALUES, IN_RPM
from tests.ingest.samples import CANONICAL, changed, record, with_cell, write

FILES = (*BROKEN_TABLES, *BROKEN_VALUES)


@pytest.mark.parametrize("refusal", FILES, ids=lambda refusal: refusal.title.replace(" ", "-"))
def test_broken_file_is_refused_with_its_named_error(tmp_path: Path, refusal: Refusal) -> None:
    """Class, message and position of the error match the fault in the file."""
    path = tmp_path / "run3.csv"
    path.write_bytes(refusal.content)

    with pytest.raises(errors.RunFileError, match=refusal.words) as caught:
        read_run(path)

    assert type(caught.value) is refusal.error
    assert caught.value.file == "run3.csv"
    assert refusal.row in (None, caught.value.row)
    assert refusal.column in (None, caught.value.column)
    assert str(caught.value).startswith("run3.csv")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1500
    # A reader does not know whether its user is at the command line, in a notebook or at the page.
    assert "--map" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "channel"),
    [
        (changed(temperature_degC=np.linspace(293.0, 310.0, 40)), "temperature_degC"),
        (changed(voltage_V=record()["voltage_V"] * 1e3), "voltage_V"),
        (changed(current_A=np.linspace(-3e4, 3e4, 40)), "current_A"),
        (changed(speed_rad_s=np.linspace(0.0, 1e5, 40)), "speed_rad_s"),
        (write(IN_RPM), "speed_rad_s"),
    ],
)
def test_mapping_of_the_error_reads_a_file_in_another_unit(
    tmp_path: Path, content: bytes, channel: str
) -> None:
    """Each file has one channel in K, mV, mA or rpm; the mapping shown names that unit."""
    path = tmp_path / "run3.csv"
    path.write_bytes(content)
    with pytest.raises(errors.AbsurdValue) as caught:
        read_run(path)
    [example] = caught.value.examples

    run = read_run(path, mapping=example)

    assert run.sources[channel].unit != channel.split("_", 1)[1].replace("_", "/")
    with pytest.raises(errors.AbsurdValue):
        read_run(path, name="run4.csv", mapping=example)


def test_sample_counter_is_offered_as_a_time_and_never_as_a_current(tmp_path: Path) -> None:
    """Counter, PWM count and rpm, as boards without a current sensor print them.

    The counter times an interval, with the other channels, is a run.
    """
    columns = {"Sample": np.arange(40.0), "PWM": record()["voltage_V"] * 10.0}
    path = tmp_path / "run3.csv"
    path.write_bytes(write({**columns, "Motor Speed (RPM)": record()["speed_rad_s"]}))

    with pytest.raises(errors.MissingColumn) as caught:
        read_run(path)

    text = str(caught.value)
    assert "current_A may be" not in text
    assert "without a current, voltage and speed determine only the gain" in text
    wanted = {"time_s": {"column": "Sample", "scale": "SECONDS_PER_SAMPLE"}}
    assert wanted in caught.value.examples
    entries = {"time_s": {"column": "Sample", "scale": 1e-3}, "voltage_V": {"column": "PWM"}}
    path.write_bytes(write({**columns, "n [rpm]": columns["PWM"], "I [A]": record()["current_A"]}))
    assert np.array_equal(read_run(path, mapping=entries).time, columns["Sample"] * 1e-3)


def test_name_of_angle_and_temperature_without_a_unit_gives_one_message(tmp_path: Path) -> None:
    """The mappings are alternatives: both together would use the column twice."""
    path = tmp_path / "run3.csv"
    theta = record()["temperature_degC"]
    path.write_bytes(write({**{name: record()[name] for name in CANONICAL[:4]}, "theta": theta}))

    with pytest.raises(errors.AmbiguousUnit, match="temperature_degC or position_rad") as caught:
        read_run(path)

    assert caught.value.further == ()
    assert [list(one) for one in caught.value.examples] == [["temperature_degC"], ["position_rad"]]
    for entry in caught.value.examples:
        assert read_run(path, mapping=entry).rows == 40


def test_time_that_runs_back_is_reported_with_the_faulty_cells(tmp_path: Path) -> None:
    """The times are checked although a cell is no number."""
    path = tmp_path / "run.csv"
    lines = with_cell("current_A", 20, "fault").decode().split("\n")
    lines[10] = lines[5]
    path.write_text("\n".join(lines))

    with pytest.raises(errors.NotANumber) as caught:
        read_run(path)

    assert "row 22, column current_A: 'fault' is not a number" in str(caught.value)
    assert "(2) row 11, column time_s: the time decreases" in str(caught.value)


def test_table_of_broken_files_covers_every_error_that_a_file_can_cause() -> None:
    """Each leaf below RunFileError is caused by a file of the table or by a test below."""
    leaves = {leaf for leaf in errors.RunFileError.__subclasses__()}

    missing = leaves - {refusal.error for refusal in FILES}

    assert missing == {
        errors.UnreadableFile,
        errors.MappingError,
        # test_formats.py, test_damage.py
        errors.OutOfMemory,
        errors.MissingLibrary,
        # test_angle.py
        errors.AmbiguousAngle,
    }
    assert len({leaf.code for leaf in leaves}) == len(leaves)
    assert len(FILES) >= 60


@pytest.mark.parametrize("name", ["missing.csv", ".", "nul\0.csv", "x" * 5000])
def test_path_that_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    """Each path is missing or not a regular file."""
    with pytest.raises(errors.UnreadableFile, match="cannot be opened|is not a regular file"):
        read_run(f"{tmp_path}/{name}")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(bytes=1000), "bytes are more than the limit of 1000"),
        (Limits(rows=20), "more rows than the limit of 20"),
        (Limits(columns=4), "5 columns are more than the limit of 4"),
    ],
)
def test_file_over_a_limit_is_refused_with_the_limit(
    tmp_path: Path, limits: Limits, words: str
) -> None:
    """The canonical file has 41 lines, five columns and some 1,800 bytes."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record()))

    with pytest.raises(errors.FileTooLarge, match=words):
        read_run(path, limits=limits)


def with_cells(faulty: dict[tuple[int, int], str], rows: int = 40) -> bytes:
    """Canonical file with other texts in some cells, by sample and position of the column."""
    lines = [line.split(",") for line in write(record(rows)).decode().splitlines()]
    for (sample, column), text in faulty.items():
        lines[sample + 1][column] = text
    return "".join(",".join(cells) + "\n" for cells in lines).encode()


def test_impossible_values_of_several_channels_are_reported_at_once() -> None:
    """Voltage in mV and current in units of 10 uA: each error has its own channel and mapping."""
    columns = record()
    columns["voltage_V"] = columns["voltage_V"] * 1e3
    columns["current_A"] = columns["current_A"] * 1e5

    with pytest.raises(errors.AbsurdValue) as caught:
        read_run(pd.DataFrame(columns))

    found = [caught.value, *caught.value.further]
    assert [error.column for error in found] == ["voltage_V", "current_A"]
    assert all(error.examples for error in found)


@given(
    faulty=st.dictionaries(
        st.tuples(st.integers(1, 39), st.integers(0, 4)),
        st.sampled_from(["fault", "NaN", "1.2.3", "1e999"]),
        min_size=1,
        max_size=12,
    )
)
@settings(max_examples=40, deadline=None)
def test_one_error_reports_every_column_and_kind_of_fault(
    faulty: dict[tuple[int, int], str],
) -> None:
    """Expected are the cells that were broken: each column and kind once, with its first line.

    The first sample is sound, because the layout of the table is taken from it.
    """
    first: dict[tuple[str, str], int] = {}
    for (sample, column), text in sorted(faulty.items()):
        kind = "not_a_number" if text in ("fault", "1.2.3") else "not_finite"
        first.setdefault((kind, CANONICAL[column]), sample + 2)

    with TemporaryDirectory() as folder:
        path = Path(folder, "run.csv")
        path.write_bytes(with_cells(faulty))
        with pytest.raises(errors.RunFileError) as caught:
            read_run(path)

    reported = [caught.value, *caught.value.further]
    assert {(e.code, e.column): e.row for e in reported if isinstance(e, errors.RunFileError)} == (
        first
    )
    assert len(reported) == len(first)
    assert caught.value.row == min(first.values())


def test_faulty_cells_of_a_column_are_listed_by_ranges_of_lines(tmp_path: Path) -> None:
    """A sensor is disconnected over samples 5 to 20, on lines 7 to 22; cell 30 holds a word."""
    faulty = {(sample, 2): "NaN" for sample in range(5, 21)} | {(30, 2): "fault", (31, 2): "-"}
    path = tmp_path / "run.csv"
    path.write_bytes(with_cells(faulty))

    with pytest.raises(errors.NotFinite) as caught:
        read_run(path)

    assert "row 7, column current_A: 'NaN' is not a finite number" in str(caught.value)
    assert "the same in rows 8 to 22 ('NaN')" in str(caught.value)
    assert "row 32, column current_A: 'fault' is not a number" in str(caught.value)
    assert "the same in row 33 ('-')" in str(caught.value)


def test_reading_stops_where_a_file_has_too_many_faults(tmp_path: Path) -> None:
    """The limit is 10,000 faults: two cells of 5,000 lines, of which the first is line 2."""
    path = tmp_path / "run.csv"
    path.write_bytes(with_cells({(k, column): "-" for k in range(6000) for column in (1, 2)}, 6000))

    with pytest.raises(
        errors.NotANumber, match="stopped at row 5001, after 10000 faults"
    ) as caught:
        read_run(path)

    assert [error.column for error in caught.value.further] == ["current_A"]
    assert len(str(caught.value)) < 1500


def test_faults_above_a_truncated_last_line_are_reported_without_it(tmp_path: Path) -> None:
    """The last line lost its last cells with the power; line 5 holds a word."""
    path = tmp_path / "run.csv"
    path.write_bytes(with_cells({(3, 1): "fault"}).rsplit(b",", 2)[0])

    with pytest.raises(errors.NotANumber) as caught:
        read_run(path)

    assert (caught.value.row, caught.value.further) == (5, ())


def test_frame_with_missing_values_is_refused_with_all_of_them() -> None:
    """Rows are those of the index: no voltage in rows 5 to 7, infinite current in row 9."""
    frame = pd.DataFrame(record())
    frame.loc[5:7, "voltage_V"] = np.nan
    frame.loc[9, "current_A"] = -np.inf

    with pytest.raises(errors.MissingValue) as caught:
        read_run(frame)

    assert "row 5, column voltage_V: the cell is blank" in str(caught.value)
    assert "the same in rows 6 to 7" in str(caught.value)
    assert "row 9, column current_A: '-inf' is not a finite number" in str(caught.value)
