"""Valid tables with an invalid cell, with the expected error of each."""

from __future__ import annotations

import numpy as np

from identification import errors
from tests.ingest.broken_tables import Refusal, beside
from tests.ingest.samples import (
    CANONICAL,
    Dialect,
    changed,
    record,
    renamed,
    with_cell,
    with_line,
    write,
)


def swapped_lines(first: int, second: int) -> bytes:
    """Canonical file with two lines exchanged."""
    lines = write(record()).decode().splitlines()
    lines[first - 1], lines[second - 1] = lines[second - 1], lines[first - 1]
    return "\n".join(lines).encode() + b"\n"


TIME = record()["time_s"]
HEADER = ",".join(CANONICAL).encode()
CLOCK = (
    b"time_s,voltage_V,current_A,speed_rad_s\n"
    + b"".join(b"2026-01-05 10:00:%02d,1.5,2.5,%d\n" % (second, second) for second in range(10))
    + b"0.01,1.5,2.5,3\n" * 5
)
POSITION = {"position_rad": np.concatenate(([0.0], np.cumsum(np.full(399, 0.1))))}
IN_RPM = {**record(400), "speed_rad_s": np.full(400, 100.0) * 60.0 / (2.0 * np.pi), **POSITION}

BROKEN_VALUES = (
    Refusal(
        "a word",
        with_cell("current_A", 3, "fault"),
        errors.NotANumber,
        "'fault' is not a number; expected a plain number in A",
        5,
        "current_A",
    ),
    Refusal("a word first", with_cell("time_s", 0, "start"), errors.NotANumber, "'start'", 2),
    Refusal(
        "a word in most cells",
        with_line(2, "0.0,bad,bad,bad,bad"),
        errors.NotANumber,
        "'bad' is not a number",
        2,
        "voltage_V",
    ),
    Refusal("a word at the end", with_cell("speed_rad_s", 39, "-"), errors.NotANumber, "'-'", 41),
    Refusal("a unit in the cell", with_cell("voltage_V", 3, "12 V"), errors.NotANumber, "'12 V'"),
    Refusal("hexadecimal", with_cell("voltage_V", 3, "0x1F"), errors.NotANumber, "'0x1F'"),
    Refusal("underscores", with_cell("voltage_V", 3, "1_000"), errors.NotANumber, "'1_000'"),
    Refusal("digits of another script", with_cell("voltage_V", 3, "١٢"), errors.NotANumber, "is n"),
    Refusal("a formula", with_cell("voltage_V", 3, "=1+2"), errors.NotANumber, "'=1"),
    Refusal("two points", with_cell("voltage_V", 3, "1.2.3"), errors.NotANumber, "'1.2.3'"),
    Refusal("half an exponent", with_cell("voltage_V", 3, "1e"), errors.NotANumber, "'1e'"),
    Refusal(
        "an escape sequence", with_cell("voltage_V", 3, "\x1b[31m1"), errors.NotANumber, r"\\x1b"
    ),
    Refusal(
        "a thousand characters",
        with_cell("voltage_V", 3, "x" * 5000),
        errors.NotANumber,
        r"x\.\.\.",
    ),
    Refusal(
        "a number below times of day",
        CLOCK,
        errors.NotANumber,
        "'0.01' is no time like that of the first sample",
        12,
        "time_s",
    ),
    Refusal(
        "header in the middle",
        with_line(20, HEADER.decode()),
        errors.NotANumber,
        "'time_s'",
        20,
        "time_s",
    ),
    Refusal(
        "thousands",
        write({**record(), "speed_rad_s": np.arange(40.0)}, Dialect(delimiter=";")).replace(
            b";20.0;", b";1,020;"
        ),
        errors.NotANumber,
        "one decimal sign throughout",
    ),
    Refusal(
        "thousands or decimals",
        b"time_ms;voltage_V;current_mA;speed_rpm\n"
        + b"".join(b"%d;%d;1,%03d;2,500\n" % (k, k, k) for k in range(20)),
        errors.NotANumber,
        "may be a decimal comma",
        2,
    ),
    Refusal(
        "mixed decimal signs",
        write(record(), Dialect(";", ",")).replace(b",", b".", 1),
        errors.NotANumber,
        "one decimal sign",
    ),
    Refusal(
        "decimal commas between commas",
        write(record(), Dialect(",", ",")),
        errors.RaggedRow,
        "the comma is both the decimal sign and the delimiter",
    ),
    Refusal(
        "decimal commas between commas, no header",
        write(record(), Dialect(",", ",")).split(b"\n", 1)[1],
        errors.RaggedRow,
        "the comma is both the decimal sign and the delimiter",
    ),
    Refusal(
        "not a number", with_cell("current_A", 3, "NaN"), errors.NotFinite, "'NaN'", 5, "current_A"
    ),
    Refusal(
        "NaN temperature",
        with_cell("temperature_degC", 3, "nan"),
        errors.NotFinite,
        "'nan'",
        5,
        "temperature_degC",
    ),
    Refusal("infinity", with_cell("speed_rad_s", 3, "-inf"), errors.NotFinite, "'-inf'", 5),
    Refusal("PicoScope's overflow", with_cell("speed_rad_s", 3, "∞"), errors.NotFinite, "'∞'", 5),
    Refusal("Excel's error", with_cell("speed_rad_s", 3, "#N/A"), errors.NotFinite, "'#N/A'", 5),
    Refusal("Visual C's NaN", with_cell("speed_rad_s", 3, "1.#QNAN"), errors.NotFinite, "QNAN", 5),
    Refusal("overflow", with_cell("speed_rad_s", 3, "1e999"), errors.NotFinite, "'1e999'", 5),
    Refusal(
        "blank cell",
        with_cell("voltage_V", 3, ""),
        errors.MissingValue,
        "the cell is blank",
        5,
        "voltage_V",
    ),
    Refusal(
        "blank time", with_cell("time_s", 3, "  "), errors.MissingValue, "the cell is blank", 5
    ),
    Refusal("line of blanks", with_line(9, ",,,,"), errors.MissingValue, "all cells are blank", 9),
    Refusal("short line", with_line(9, "0.007,1.0"), errors.RaggedRow, "2 fields, expected 5", 9),
    Refusal(
        "long line", with_line(9, "0.007,1,2,3,4,5,6"), errors.RaggedRow, "7 fields, expected 5", 9
    ),
    Refusal(
        "one short and one long",
        with_line(9, "0.007,1,2,3").replace(b"\n0.012,", b"\n0.012,1,"),
        errors.RaggedRow,
        "4 fields",
        9,
    ),
    Refusal(
        "too few names",
        renamed().replace(b",temperature_degC", b"", 1),
        errors.RaggedRow,
        "have 5 fields and the header has 4",
        2,
    ),
    Refusal("open quote", with_cell("voltage_V", 3, '"1.0'), errors.UnclosedQuote, "not closed", 5),
    Refusal(
        "repeated time",
        with_cell("time_s", 3, "0.002"),
        errors.RepeatedTime,
        "0.002 s is repeated",
        5,
        "time_s",
    ),
    Refusal("time of one value", changed(time_s=1.5), errors.RepeatedTime, "repeated", 3),
    Refusal(
        "backward time", swapped_lines(8, 20), errors.BackwardTime, "decreases from", 9, "time_s"
    ),
    Refusal("time that runs down", changed(time_s=TIME[::-1]), errors.BackwardTime, "decreases", 3),
    Refusal(
        "counter overflow",
        changed(time_s=np.where(TIME < 0.02, TIME + 4294.9, TIME)),
        errors.BackwardTime,
        "overflow",
        22,
    ),
    Refusal(
        "two runs in a file",
        write(record()) + write(record()).split(b"\n", 1)[1],
        errors.BackwardTime,
        "one run in order of time",
        42,
    ),
    Refusal(
        "700 degC",
        with_cell("temperature_degC", 7, "700"),
        errors.AbsurdValue,
        "700 degC is impossible for a brushed motor",
        9,
        "temperature_degC",
    ),
    Refusal(
        "below absolute zero",
        with_cell("temperature_degC", 7, "-300"),
        errors.AbsurdValue,
        "-300 degC",
        9,
    ),
    Refusal(
        "kelvin",
        changed(temperature_degC=np.linspace(293.0, 310.0, 40)),
        errors.AbsurdValue,
        "are probably in kelvin",
        2,
    ),
    Refusal(
        "Celsius as kelvin",
        renamed(temperature_degC="temperature [K]"),
        errors.AbsurdValue,
        "is it in kelvin",
    ),
    Refusal(
        "millivolts",
        changed(voltage_V=record()["voltage_V"] * 1e3),
        errors.AbsurdValue,
        "is it in millivolts",
        2,
        "voltage_V",
    ),
    Refusal(
        "milliamperes",
        changed(current_A=np.linspace(-3e4, 3e4, 40)),
        errors.AbsurdValue,
        "is it in milliamperes",
    ),
    Refusal(
        "impossible speed",
        changed(speed_rad_s=np.linspace(0.0, 1e5, 40)),
        errors.AbsurdValue,
        "is it in rpm",
    ),
    Refusal(
        "speed in rpm, as the position shows",
        write(IN_RPM),
        errors.AbsurdValue,
        "the speed is in rpm",
        None,
        "speed_rad_s",
    ),
    Refusal(
        "a thousand and one columns",
        beside(**{f"channel{k}": 0.0 for k in range(996)}),
        errors.FileTooLarge,
        "1001 columns",
    ),
    Refusal(
        "a line of three megabytes",
        write(record()) + b"1" * 3_000_000,
        errors.LineTooLong,
        "more than 1000000 bytes",
        42,
    ),
    Refusal(
        "a cell of three megabytes",
        write(record()).replace(b"\n", b"\n" + b"1" * 3_000_000, 1),
        errors.LineTooLong,
        "more than 1000000 bytes",
        2,
    ),
    Refusal(
        "a header of a thousand and one characters",
        beside(**{"a" + " " * 999 + "b": 0.0}),
        errors.HeaderTooLong,
        "a header of 1001 characters; expected at most 1000",
        1,
        "6",
    ),
)
