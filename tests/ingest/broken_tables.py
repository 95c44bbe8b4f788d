"""Files that are invalid as text or as tables, with the expected error of each."""

from __future__ import annotations

import gzip
import io
import zipfile
from dataclasses import dataclass

import numpy as np

from identification import errors
from tests.ingest.devices import REPEATED_LVM, YOKOGAWA, text
from tests.ingest.samples import CANONICAL, Dialect, record, renamed, with_cell, with_line, write
from tests.ingest.writers import rows


@dataclass(frozen=True)
class Refusal:
    """A broken file and the expected error."""

    title: str
    content: bytes
    error: type[errors.RunFileError]
    words: str
    row: int | None = None
    column: str | None = None


def without(*names: str) -> bytes:
    """Canonical file without some columns."""
    return write({name: column for name, column in record().items() if name not in names})


def beside(**columns: float) -> bytes:
    """Canonical file with additional constant columns."""
    extra = {name: np.full(40, value) for name, value in columns.items()}
    return write({**record(), **extra})


def zipped(*names: str, content: bytes = write(record())) -> bytes:
    """Archive with the same content under several names."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in names:
            archive.writestr(name, content)
    return buffer.getvalue()


def spoilt_gzip() -> bytes:
    """Compressed run with one wrong bit, which the checksum shows."""
    content = bytearray(gzip.compress(write(record())))
    content[-6] ^= 1
    return bytes(content)


def doubled_header(name: str) -> bytes:
    """Canonical file with one column name twice."""
    lines = write(record()).decode().splitlines()
    lines[0] += f",{name}"
    return "\n".join(line + ("" if at == 0 else ",1.0") for at, line in enumerate(lines)).encode()


def oscilloscope(channels: int) -> bytes:
    """Columns of an oscilloscope, which have numbers and volts."""
    names = ["x-axis", *map(str, range(1, channels + 1))]
    table = dict(zip(names, record().values(), strict=False))
    header, rest = write(table).split(b"\n", 1)
    return b"\n".join([header, b",".join([b"second", *channels * [b"Volt"]]), rest])


def beside_samples() -> bytes:
    """One channel of Tektronix, with settings left of the samples."""
    left = ["Record Length,40,", "Source,CH1,", "Vertical Units,V,", "Horizontal Units,s,"]
    lines = [f"{one},{k},{k % 3}," for k, one in enumerate(left + [",,"] * 36)]
    return "\n".join([*lines, ""]).encode()


def numbered_channels(header: str, first: int = 0) -> bytes:
    """Three signals under a header, and the number of each sample."""
    lines = [f"{first + k},{k % 3}.5,{k % 2}.5,{k % 5}.5" for k in range(40)]
    return "\n".join([header, *lines, ""]).encode()


TIME = record()["time_s"]
HEADER = ",".join(CANONICAL).encode()

BROKEN_TABLES = (
    Refusal("no bytes", b"", errors.EmptyFile, "empty"),
    Refusal("a byte order mark alone", b"\xef\xbb\xbf", errors.EmptyFile, "empty"),
    Refusal("blank lines", b"\n\r\n  \n\t\n", errors.EmptyFile, "blank lines"),
    Refusal("header alone", HEADER + b"\n", errors.NoRows, "no line of numbers", 1),
    Refusal("header without line end", HEADER, errors.NoRows, "no line of numbers", 1),
    Refusal("nine samples", write(record(9)), errors.TooFewRows, "9 samples", 10),
    Refusal("prose", b"Dear colleague,\nthe motor broke.\n", errors.NoTable, "no line with numb"),
    Refusal("one column", b"time_s\n0.1\n0.2\n0.3\n", errors.NoTable, "no line with numbers"),
    Refusal("comments alone", b"# time\n# volt\n", errors.NoTable, "no line with numbers"),
    Refusal("HTML", b"<!DOCTYPE html>\n<html><p>404</p></html>\n", errors.NoTable, "numbers"),
    Refusal("JSON", b'{"time_s": [0.0, 0.1], "voltage_V": 3}\n', errors.NotText, "this is JSON"),
    Refusal(
        "numbers alone",
        with_line(1, None),
        errors.NoHeader,
        'names their 5 columns, which are .column 1. to .*"time_s": {"column": "column NUMBER"',
    ),
    Refusal(
        "two runs in a zip",
        zipped("a.csv", "b.csv"),
        errors.AmbiguousTable,
        "the files 'a.csv', 'b.csv' all contain a run",
    ),
    Refusal("zip in zip", zipped("a", content=zipped("b")), errors.NotText, "in another archive"),
    Refusal("cut zip", zipped("a.csv")[:-30], errors.DamagedFile, "looks like a zip archive"),
    Refusal("zip of a note", zipped("a", content=b"cold run"), errors.NoTable, "no line with"),
    Refusal("empty zip", zipped(), errors.NoTable, "no file with columns of numbers"),
    Refusal("many files", zipped(*map(str, range(21))), errors.FileTooLarge, "unpack it"),
    Refusal("spoilt zip", zipped("a").replace(b"0.02,", b"0.03,"), errors.DamagedFile, "CRC"),
    Refusal("gzip in gzip", gzip.compress(gzip.compress(b"")), errors.NotText, "twice"),
    Refusal(
        "cut gzip", gzip.compress(write(record()))[:500], errors.DamagedFile, "damaged .*ended"
    ),
    Refusal("spoilt gzip", spoilt_gzip(), errors.DamagedFile, "compression is damaged"),
    Refusal("TDMS index", b"TDSh" + b"\x0e\0\0\0" * 20, errors.NotText, "beside it"),
    Refusal("picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 99, errors.NotText, "picture"),
    Refusal("zeros", bytes(5000), errors.NotText, "not text"),
    Refusal("noise", np.random.default_rng(3).bytes(5000), errors.NotText, "not text"),
    Refusal(
        "16-bit samples",
        np.round(127 + 120 * np.sin(np.arange(5000) / 20)).astype("<i2").tobytes(),
        errors.NotText,
        "not text",
    ),
    Refusal(
        "UTF-32 without mark",
        write(record(), Dialect(encoding="utf-32-le")),
        errors.NotText,
        "not text",
    ),
    Refusal("UTF-32", write(record(), Dialect(encoding="utf-32")), errors.NotText, "UTF-32"),
    Refusal("NUL tail", write(record()) + bytes(64), errors.NotText, "lost power", 42),
    Refusal("NUL within", with_cell("current_A", 5, "1\0"), errors.NotText, "NUL byte", 7),
    Refusal(
        "no voltage",
        without("voltage_V"),
        errors.MissingColumn,
        "no column for voltage_V; the file has",
        None,
        "voltage_V",
    ),
    Refusal("no time", without("time_s"), errors.MissingColumn, "no column for time_s"),
    Refusal(
        "three missing",
        without("time_s", "current_A", "speed_rad_s"),
        errors.MissingColumn,
        "no column for time_s, current_A, speed_rad_s",
    ),
    Refusal(
        "an oscilloscope",
        oscilloscope(3),
        errors.MissingColumn,
        "time_s is 'x-axis'; '1', '2', '3' in Volt have no name of a channel; the file .*"
        '"voltage_V": {"column": "1", "scale": "V_PER_V"}, "current_A": .*"A_PER_V"',
    ),
    Refusal(
        "an oscilloscope of two channels",
        oscilloscope(2),
        errors.MissingColumn,
        'record 1 more, .*"speed_rad_s": {"column": "HEADER TEXT"',
    ),
    Refusal(
        "settings beside one channel",
        beside_samples(),
        errors.MissingColumn,
        "voltage_V may be 'CH1'; .*`motorid join FILE FILE FILE",
    ),
    Refusal(
        "numbered channels without units",
        numbered_channels("Sample,Channel 1,Channel 2,Channel 3"),
        errors.MissingColumn,
        r"'Channel 1', 'Channel 2', 'Channel 3' without a unit have no name.*'Sample' times.*"
        '"time_s": {"column": "Sample", "scale": "SECONDS_PER_SAMPLE"}, '
        '"voltage_V": {"column": "Channel 1", "scale": "V_PER_V"}',
    ),
    Refusal(
        "names with a path",
        numbered_channels("time [s],Drive.U[V],Drive.I[A],Drive.n[1/min]"),
        errors.MissingColumn,
        r"speed_rad_s may be 'Drive.n\[1/min\]'; the file has [^;]*; name them in the header, or",
    ),
    Refusal(
        "ticks of Windows as a time",
        numbered_channels("time [ms],u [V],i [A],n [rpm]", 134_000_000_000_000_000),
        errors.AmbiguousUnit,
        "may be time_s, but has no unit",
    ),
    Refusal(
        "values without times",
        b"#CLOCK=1.00mS\n" + b"11.9,\n12.1,\n" * 20,
        errors.NoTable,
        "most lines have a single number: export the time",
    ),
    Refusal(
        "the header of an oscilloscope twice",
        2 * text(YOKOGAWA, [[None, *row[1:]] for row in rows()]).encode(),
        errors.UnsupportedContent,
        "a second header within the samples, at 'TraceName'; let the device write one header",
    ),
    Refusal(
        "the same segment twice",
        REPEATED_LVM.encode(),
        errors.UnsupportedContent,
        "a segment begins 0 s after the first one, which is before the end of the one above it",
        row=81,
    ),
    Refusal(
        "values with labels",
        b"".join(b"U is %d.5,I is 0.5,n is %d.5\n" % (k % 12, k) for k in range(20)),
        errors.NoTable,
        "the numbers stand within other text: write them alone, and names above them",
    ),
    Refusal(
        "an oscilloscope in mV",
        oscilloscope(3).replace(b"Volt", b"mV"),
        errors.MissingColumn,
        '"voltage_V": {"column": "1", "scale": "V_PER_V", "unit": "mV"}, '
        '"current_A": {"column": "2", "scale": "A_PER_mV"}, '
        '"speed_rad_s": {"column": "3", "scale": "RAD_S_PER_mV"}',
    ),
    Refusal(
        "a set point only",
        renamed(speed_rad_s="speed_set_rad_s"),
        errors.MissingColumn,
        "no column for speed_rad_s; the file has",
    ),
    Refusal(
        "a numbered motor",
        renamed(speed_rad_s="1st motor speed [rpm]"),
        errors.MissingColumn,
        "speed_rad_s may be '1st motor speed",
    ),
    Refusal("another's name", renamed(current_A="CH2"), errors.MissingColumn, "'CH2'"),
    Refusal(
        "unit not given",
        renamed(speed_rad_s="speed"),
        errors.AmbiguousUnit,
        "rad/s, deg/s, rev/s, rpm, krpm",
        None,
        "speed",
    ),
    Refusal("a letter for a unit", renamed(voltage_V="V"), errors.AmbiguousUnit, "has no unit"),
    Refusal("t for a time", renamed(time_s="t"), errors.AmbiguousUnit, "s, ms, us, ns, min"),
    Refusal(
        "two units",
        write(record(), units=["ms", "V", "A", "rad/s", "degC"]),
        errors.AmbiguousUnit,
        "two units, 's', 'ms'",
        None,
        "time_s",
    ),
    Refusal(
        "unknown unit",
        renamed(speed_rad_s="speed [furlong/h]"),
        errors.UnknownUnit,
        "'furlong/h' is unknown; write one of rad/s",
        None,
        "speed [furlong/h]",
    ),
    Refusal(
        "mega for milli",
        renamed(current_A="current_MA"),
        errors.UnknownUnit,
        "'MA' is unknown \\(case-sensitive; did you mean mA\\?\\)",
    ),
    Refusal(
        "ticks", beside(**{"position [ticks]": 1.0}), errors.UnknownUnit, '"position_rad": null'
    ),
    Refusal(
        "degrees for a temperature",
        renamed(temperature_degC="temperature [deg]"),
        errors.WrongUnit,
        "deg is a unit of angle",
    ),
    Refusal(
        "a current in volts",
        renamed(current_A="current_sensor_V"),
        errors.WrongUnit,
        r'"column": "current_sensor_V", "scale": "NUMBER"',
        None,
        "current_sensor_V",
    ),
    Refusal(
        "two candidates",
        renamed(speed_rad_s="speed [rpm]", temperature_degC="n [1/min]"),
        errors.AmbiguousColumn,
        r"'speed \[rpm\]', 'n \[1/min\]' are all possible for speed_rad_s",
    ),
    Refusal(
        "a name twice",
        doubled_header("current_A"),
        errors.DuplicateColumn,
        "columns 3, 6",
        None,
        "current_A",
    ),
)
