"""Labels, units, separators and clocks of loggers: read as stated, or refused where they change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification import errors
from identification.ingest import read_run
from identification.ingest.read import list_columns
from identification.ingest.several_files import join_files
from tests.ingest.devices import text
from tests.ingest.loggers import long, thousands, with_affixes
from tests.ingest.samples import channels
from tests.ingest.writers import RECORD, rows

UNITS = with_affixes("{value} {unit}", ",", ("Time,Voltage,Current,Speed,Temperature",))
LABELS = with_affixes("{label}:{value} {unit}", ",")
CLOCKED = text(
    ("Time,ms,voltage_V,current_A,speed_rad_s",),
    [["08:00:00", k, *row[1:4]] for k, row in enumerate(rows())],
)
LONG = long("Time[s];Name;Value;Unit", "{time};{name};{value};{unit}")


@pytest.mark.parametrize(
    ("content", "old", "new", "error", "words"),
    [
        (UNITS, "0.003 s,", "3 ms,", errors.NotANumber, "row 5, column Time: '3 ms' is not a"),
        (UNITS, "0.003 s,", "0.003,", errors.NotANumber, "'0.003 (without s)' is not a number"),
        (LABELS, "t:0.003 s,", "0.003 s,", errors.NotANumber, "row 4, column t: '0.003 s' is not"),
        (LABELS, "t:0.003 s,U", "U:0.003 s,U", errors.NotANumber, "column t: 'U:0.003 s' is not"),
        (CLOCKED, "08:00:00,3,", "08:00:00,1003,", errors.AmbiguousColumn, "'Time', 'ms' are all"),
        (LONG, "0.003;Speed;", "0.003;Speed;x", errors.NotANumber, "row 16, column Speed: 'x23."),
        (LONG, "0.003;Speed;", "x;Speed;", errors.NotANumber, "row 16, column Time[s]: 'x'"),
        (LONG, ";Temperature;", ";", errors.RaggedRow, "row 5: the row has 3 cells and the head"),
        (LONG, ";Temperature;", ";;Temperature;", errors.RaggedRow, "row 5: the row has 5 cells"),
        (LONG, LONG.partition("\n")[2], "", errors.NoRows, "no row below the header"),
    ],
)
def test_cell_unlike_the_first_sample_is_refused(
    tmp_path: Path, content: str, old: str, new: str, error: type[Exception], words: str
) -> None:
    """One cell is changed; the message has its line and the value."""
    path = tmp_path / "run.csv"
    assert old in content
    path.write_text(content.replace(old, new, 1 if error is not errors.RaggedRow else -1))

    with pytest.raises(error) as caught:
        read_run(path)

    assert words in str(caught.value)


@pytest.mark.parametrize(("group", "decimal"), [(".", ","), (",", "."), ("'", "."), ("’", ",")])
def test_separators_between_thousands_are_removed(tmp_path: Path, group: str, decimal: str) -> None:
    """The speed falls below 1,000 deg/s with one decimal, in steps of 1."""
    path = tmp_path / "run.csv"
    path.write_text(thousands(group, decimal), encoding="utf-8")

    run = read_run(path)

    np.testing.assert_allclose(np.degrees(run.speed), 1020.5 - np.arange(40), rtol=1e-15)
    assert np.array_equal(run.voltage, RECORD["voltage_V"])


def test_separators_in_most_cells_of_the_first_samples_are_removed(tmp_path: Path) -> None:
    """The first ten samples are above 1,000 in three of four columns, the others below."""
    path = tmp_path / "run.csv"
    sizes = [1234.5] * 10 + [-234.5] * 30
    lines = [f"{k};" + ";".join([f"{x:,.1f}"] * 3) for k, x in enumerate(sizes)]
    path.write_text("\n".join(["time_ms;voltage_mV;current_mA;speed_deg_s", *lines, ""]))

    np.testing.assert_allclose(1e3 * read_run(path).voltage, sizes, rtol=1e-15)


def test_words_above_labelled_lines_are_no_names(tmp_path: Path) -> None:
    """As many words as there are labels."""
    path = tmp_path / "run.txt"
    lines = [f"U:{r[1]} I:{r[2]} n:{r[3]}" for r in rows()]
    path.write_text("\n".join(["motor board ready", *lines, ""]))

    assert [column.title for column in list_columns(path)] == ["U", "I", "n"]


def test_a_time_of_two_columns_has_both_names(tmp_path: Path) -> None:
    """Neither of them is left over, and either name serves a mapping."""
    path = tmp_path / "run.csv"
    path.write_text(CLOCKED)

    run = read_run(path)

    assert run.sources["time_s"].header == "Time, ms"
    assert "unused_columns" not in {w.code for w in run.warnings}
    for title in ("Time, ms", "Time"):
        mapped = read_run(path, mapping={"time_s": {"column": title}})
        assert np.array_equal(mapped.time, RECORD["time_s"])


@pytest.mark.parametrize(
    ("stamp", "clock", "other"),
    [
        ("08:00:{:02d}", "time", "latency [ms]"),
        ("17723520{:02d}", "timestamp [s]", "latency [ns]"),
    ],
)
def test_a_latency_is_no_fraction_of_the_time(
    tmp_path: Path, stamp: str, clock: str, other: str
) -> None:
    """Added to whole seconds, the latency of the bus would be a jitter of the clock."""
    lines = [f"{clock},{other},{','.join([*RECORD][1:])}"]
    for k, row in enumerate(rows()):
        lines.append(f"{stamp.format(k)},{k % 7 + 1},{','.join(map(str, row[1:]))}")
    path = tmp_path / "run.csv"
    path.write_text("\n".join([*lines, ""]))

    run = read_run(path)

    assert np.array_equal(np.diff(run.time), np.ones(39))


def test_a_label_without_a_unit_is_no_quantity(tmp_path: Path) -> None:
    """The labels U, I and n are names; their units are asked for, and so is the time."""
    path = tmp_path / "run.txt"
    path.write_text("\n".join(f"U:{r[1]} I:{r[2]} n:{r[3]}" for r in rows()) + "\n")

    with pytest.raises(errors.RunFileError) as caught:
        read_run(path)

    text = str(caught.value)
    for words in ("column U: the column may be voltage_V, but has no unit", "time row / rate"):
        assert words in text


def test_columns_without_names_are_offered_by_number_beside_a_stated_clock(
    tmp_path: Path,
) -> None:
    """Hantek: the clock is a comment, so only the channels are asked for."""
    path = tmp_path / "run.csv"
    path.write_text(text(("# CLOCK=1.00mS",), [row[1:4] for row in rows()]))

    with pytest.raises(errors.MissingColumn, match="no column for voltage_V, cur") as caught:
        read_run(path)

    entries = {key: entry for each in caught.value.examples for key, entry in each.items()}
    assert entries["voltage_V"] == {"column": "column 1", "scale": "V_PER_V"}
    assert "time_s" not in entries


@pytest.mark.parametrize(
    ("content", "cut", "samples"), [(UNITS, "66 degC", 39), (LONG, ";12.5;degC", 40)]
)
def test_a_torn_last_line_is_omitted(tmp_path: Path, content: str, cut: str, samples: int) -> None:
    """Without its unit the number may lack digits; the last temperature alone may be missing."""
    path = tmp_path / "run.csv"
    path.write_text(content.rstrip()[: -len(cut)])

    run = read_run(path)

    assert run.rows == samples
    assert "truncated_last_row" in {w.code for w in run.warnings}


def test_signals_at_their_own_rates_come_to_the_clock_of_the_voltage(tmp_path: Path) -> None:
    """Speed at every other time, current 0.4 ms later, in one file with one signal per row."""
    lines = ["time_ms;signal;value"]
    for k, row in enumerate(rows()):
        lines += [f"{k};voltage_V;{row[1]}", f"{k + 0.4};current_A;{row[2]}"]
        lines += [f"{k};speed_rad_s;{row[3]}"] * (k % 2 == 0)
    path = tmp_path / "run.csv"
    path.write_text("\n".join([*lines, ""]))

    run = read_run(path)

    (note,) = (w.message for w in run.warnings if w.code == "different_clocks")
    assert "that of voltage_V (0.001 s) is used" in note
    assert "speed_rad_s (0.002 s) is interpolated linearly" in note
    # No current before 0.4 ms, no speed after 38 ms.
    assert run.rows == 38
    assert np.array_equal(run.voltage, RECORD["voltage_V"][1:39])
    later = 0.6 * RECORD["current_A"][1:39] + 0.4 * RECORD["current_A"][:38]
    np.testing.assert_allclose(run.current, later, rtol=1e-9)


def test_signals_of_one_file_are_joined_with_the_channel_of_another(tmp_path: Path) -> None:
    """Voltage and current with one signal per row, the speed in a file of its own."""
    signals, speed = ["time_s;signal;value"], ["time_s,speed_rad_s"]
    for time, voltage, current, turn, _ in rows():
        signals += [f"{time};voltage_V;{voltage}", f"{time};current_A;{current}"]
        speed.append(f"{time},{turn}")
    for name, lines in (("signals.csv", signals), ("speed.csv", speed)):
        (tmp_path / name).write_text("\n".join([*lines, ""]))

    run = join_files([tmp_path / "signals.csv", tmp_path / "speed.csv"], "run.csv")

    assert all(np.array_equal(a, RECORD[name]) for name, a in channels(run).items())
    assert run.rows == len(RECORD["time_s"])


def test_a_single_cell_with_a_label_or_a_unit_leaves_the_table_as_it_is(tmp_path: Path) -> None:
    """A column of settings beside the canonical ones, whose unit changes."""
    path = tmp_path / "run.csv"
    settings = [f"mode:{k},{'5 V' if k < 20 else 'auto'}" for k in range(40)]
    lines = [[*row, cells] for row, cells in zip(rows(), settings, strict=True)]
    path.write_text(text((",".join([*RECORD, "mode", "range"]),), lines))

    assert all(np.array_equal(a, RECORD[n]) for n, a in channels(read_run(path)).items())


def test_quoted_text_stays_one_cell_beside_numbers_with_units(tmp_path: Path) -> None:
    """Each line ends with a note that contains the delimiter."""
    path = tmp_path / "run.csv"
    head, *lines = UNITS.splitlines()
    path.write_text("\n".join([f"{head},note", *(f'{line},"cold, dry"' for line in lines), ""]))

    assert all(np.array_equal(a, RECORD[n]) for n, a in channels(read_run(path)).items())


def test_title_lines_of_numbers_with_units_are_no_samples(tmp_path: Path) -> None:
    """Thirty ranges above forty samples, with as many cells."""
    path = tmp_path / "run.csv"
    titles = ("0.5 s,5 V,2 A,10 rpm,90 degC",) * 30
    path.write_text(text((*titles, ",".join(RECORD)), rows()))

    assert all(np.array_equal(a, RECORD[n]) for n, a in channels(read_run(path)).items())


def test_times_of_day_do_not_outnumber_the_samples(tmp_path: Path) -> None:
    """HIOKI without a temperature: date, time and elapsed time beside three numbers."""
    path = tmp_path / "run.csv"
    stamps = [f"2026/03/01,08:00:00.{k:03d},00000:00:00.{k:03d}" for k in range(40)]
    lines = [[stamp, *row[1:4]] for stamp, row in zip(stamps, rows(), strict=True)]
    path.write_text(text(("Date,Time,ETime,voltage_V,current_A,speed_rad_s",), lines))

    assert np.array_equal(read_run(path).time, RECORD["time_s"])


def test_a_clock_in_the_header_is_no_column(tmp_path: Path) -> None:
    """Rigol has blank cells below its start and increment."""
    path = tmp_path / "run.csv"
    head = "voltage_V,current_A,speed_rad_s,t0 = 0.0e+00s,tInc = 1.0e-03s"
    path.write_text(text((head,), [[*row[1:4], None, None] for row in rows()]))

    titles = [column.title for column in list_columns(path)]

    assert titles == ["voltage_V", "current_A", "speed_rad_s", "time"]


def test_a_counter_without_a_name_is_offered_for_no_channel(tmp_path: Path) -> None:
    """Scopy numbers its rows in a column without a name."""
    path = tmp_path / "run.csv"
    path.write_text(text((",Time(s),CH1,CH2,CH3",), [[k, *r[:4]] for k, r in enumerate(rows())]))

    with pytest.raises(errors.MissingColumn) as caught:
        read_run(path)

    (entries,) = caught.value.examples
    assert entries["voltage_V"] == {"column": "CH1", "scale": "V_PER_V"}


def test_units_in_the_western_windows_encoding_are_read(tmp_path: Path) -> None:
    """The sign of a degree is one byte there."""
    path = tmp_path / "run.csv"
    path.write_bytes(UNITS.replace("degC", "°C").encode("cp1252"))

    assert all(np.array_equal(a, RECORD[n]) for n, a in channels(read_run(path)).items())


def test_a_wincc_archive_counts_millionths_of_a_day(tmp_path: Path) -> None:
    """The seconds of TimeString repeat; Time_ms is the date of a spreadsheet times 1e6."""
    lines = ['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"']
    for k, row in enumerate(rows()):
        ticks = f"{46_082_333_333.0 + k / 0.0864:.6f}".replace(".", ",")
        for name, value in zip(list(RECORD)[1:], row[1:], strict=True):
            lines.append(f'"{name}";"01.03.2026 08:00:00";{value};1;{ticks}')
    path = tmp_path / "run.csv"
    path.write_text("\n".join([*lines, ""]))

    run = read_run(path)

    np.testing.assert_allclose(run.time, np.arange(40.0), atol=1e-6)


@pytest.mark.parametrize(
    ("titles", "interval"),
    [
        ("Sampling interval,1ms", 1e-3),
        ("Sample period: 250 us", 250e-6),
        ('"Sample Interval","0,5","s"', 0.5),
        ("Sampling rate;10 kS/s", 1e-4),
        ("; Samplerate: 1 kHz", 1e-3),
        ("Horizontal Units,ms\nSample interval,2 ms", 2e-3),
    ],
)
def test_interval_of_a_title_line_is_the_clock(
    tmp_path: Path, titles: str, interval: float
) -> None:
    """A table without times; a warning says where they are from."""
    header = "voltage_V,current_A,speed_rad_s,temperature_degC"
    path = tmp_path / "run.csv"
    path.write_text(text((titles, header), [row[1:] for row in rows()]))

    run = read_run(path)

    np.testing.assert_allclose(run.time, interval * np.arange(40), rtol=1e-14)
    assert "time_from_rows" in {w.code for w in run.warnings}


@pytest.mark.parametrize(
    "titles",
    [
        "Sampling interval,1",
        "Time interval :,1ms,2ms",
        "Sampling rate,1 kHz\nTime interval,5 ms",
        "Clock: 16 MHz",
    ],
)
def test_an_interval_without_a_unit_or_two_different_ones_is_no_clock(
    tmp_path: Path, titles: str
) -> None:
    """The user gives the interval."""
    path = tmp_path / "run.csv"
    header = "voltage_V,current_A,speed_rad_s,temperature_degC"
    path.write_text(text((titles, header), [row[1:] for row in rows()]))

    with pytest.raises(errors.MissingColumn, match="SECONDS_PER_SAMPLE|row / rate"):
        read_run(path)


def test_a_logged_time_precedes_the_interval_of_a_title_line(tmp_path: Path) -> None:
    """The title says 1 s, and the times have steps of 1 ms."""
    path = tmp_path / "run.csv"
    path.write_text(text(("Recording interval,1 s", ",".join(RECORD)), rows()))

    assert all(np.array_equal(a, RECORD[n]) for n, a in channels(read_run(path)).items())


def test_signals_of_a_windows_file_keep_their_names_and_units(tmp_path: Path) -> None:
    """One signal per row, with an umlaut and a degree sign as single bytes."""
    path = tmp_path / "run.csv"
    content = LONG.replace("Speed", "Läuferdrehzahl").replace("degC", "°C")
    path.write_bytes(content.encode("cp1252"))

    found = {column.title: column.unit for column in list_columns(path)}

    assert "Läuferdrehzahl" in found
    assert found["Temperature"] is not None
    assert found["Temperature"].name == "degC"
