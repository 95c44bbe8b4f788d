"""Imitations of the headers that measuring devices write above their tables."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from tests.ingest.writers import RECORD, Specimen, rows

__all__ = [
    "BROKEN_LVM",
    "CHANNELS",
    "CLOCKS",
    "DEVICES",
    "DEVICE_UNITS",
    "NAMES",
    "REPEATED_LVM",
    "device",
    "numbered",
    "stamped",
    "text",
]

LVM = (
    "LabVIEW Measurement\t",
    "Writer_Version\t2",
    "Reader_Version\t2",
    "Separator\tTab",
    "Decimal_Separator\t.",
    "Multi_Headings\tNo",
    "X_Columns\t{columns}",
    "Time_Pref\tRelative",
    "Date\t2026/03/01",
    "Time\t08:00:00.5",
    "***End_of_Header***\t",
    "\t",
)
SEGMENT = {
    "Channels": "4",
    "Samples": "40",
    "Y_Unit_Label": "Volts,Amps,rad/s,Deg C",
    "X_Dimension": "Time",
    "X0": "0.0000000000000000E+0",
    "Delta_X": "0.001",
}
NAMES = ("Voltage", "Current", "Speed", "Temperature")
DEVICE_UNITS = ("V", "A", "rad/s", "degC")


def text(header: Sequence[str], samples: Sequence[Sequence[object]], delimiter: str = ",") -> str:
    """Header lines and samples."""
    body = [delimiter.join("" if c is None else str(c) for c in row) for row in samples]
    return "\r\n".join([*header, *body, ""])


def lvm(columns: str, **changes: str) -> str:
    """Imitate a file of LabVIEW with a kind of X_Columns."""
    gap = "\t\t" if columns == "Multi" else "\t"
    lines = [line.format(columns=columns) for line in LVM]
    for key, value in (SEGMENT | changes).items():
        each = value.split(",") if "," in value else [value] * 4
        lines.append(f"{key}\t{gap.join(each)}")
    lines.append("***End_of_Header***\t")
    if columns == "Multi":
        lines.append("X_Value\t" + "\tX_Value\t".join(NAMES) + "\tComment")
        samples = [[c for value in row[1:] for c in (row[0], value)] for row in rows()]
    else:
        lines.append("\t".join(["X_Value", *NAMES, "Comment"]))
        samples = [[row[0] if columns == "One" else None, *row[1:]] for row in rows()]
    return text(lines, samples, "\t")


def segments(columns: str, *, restarting: bool) -> str:
    """Imitate a file of LabVIEW with a header above every tenth sample.

    The times of a segment go on, or start again while the clock in its header goes on.
    """
    whole = lvm(columns).split("\r\n")
    above = next(k for k, line in enumerate(whole) if line.startswith("Channels"))
    end = next(k for k, line in enumerate(whole) if line.startswith("X_Value")) + 1
    title, header, samples = whole[:above], whole[above:end], whole[end:-1]
    found = list(title)
    for first in range(0, len(samples), 10):
        start = f"{0.001 * first:.3f}"
        for line in header:
            key = line.split("\t")[0]
            if key == "Samples":
                moment = datetime(2026, 3, 1, 7, 59, 59, 990_000, UTC)
                moment += timedelta(milliseconds=first * restarting)
                found.append("\t".join(["Date", *[f"{moment:%Y/%m/%d}"] * 4]))
                found.append("\t".join(["Time", *[f"{moment:%H:%M:%S.%f}"] * 4]))
                found.append("\t".join([key, *["10"] * 4]))
            elif key == "X0" and not restarting:
                found.append("\t".join([key, *[start] * 4]))
            else:
                found.append(line)
        for line in samples[first : first + 10]:
            time, *rest = line.split("\t")
            if time and restarting:
                time = f"{float(time) - 0.001 * first:.3f}"
            found.append("\t".join([time, *rest, *(["start"] if line == samples[first] else [])]))
        found.append("")
    return "\r\n".join([*found, ""])


def device(name: str, title: str, content: str, **options: object) -> Specimen:
    """Describe an imitated file."""
    mapping = options.get("mapping")
    return Specimen(
        name,
        f"{title}, imitated",
        lambda path: path.write_bytes(content.encode()),
        mapping=mapping if isinstance(mapping, dict) else None,
        is_clock_implied=options.get("implied") is True,
    )


def numbered(prefix: str, first: int = 1) -> dict[str, dict[str, str]]:
    """Mapping of numbered channels."""
    channels = list(RECORD)[1:]
    return {name: {"column": f"{prefix}{k}"} for k, name in enumerate(channels, start=first)}


def lettered() -> dict[str, dict[str, str]]:
    """Mapping of the channels of a PicoScope."""
    letters = zip(list(RECORD)[1:], "ABCD", strict=True)
    return {name: {"column": f"Channel {letter}"} for name, letter in letters}


YOKOGAWA = (
    "Header Size,11,",
    "Model Name,DL850E",
    "BlockNumber,1",
    "TraceName," + ",".join(NAMES),
    "BlockSize,40,40,40,40",
    "VUnit," + ",".join(DEVICE_UNITS),
    "HResolution,1e-3,1e-3,1e-3,1e-3",
    "HOffset,0,0,0,0",
    "Date,2026/03/01",
    "HUnit,s,s,s,s",
    "",
)
TEKTRONIX = (
    "Model,MSO54",
    "Waveform Type,ANALOG,,,,",
    "Horizontal Units,s,,,,",
    "Sample Interval,0.001,,,,",
    "Vertical Units," + ",".join(DEVICE_UNITS),
    "Label," + ",".join(NAMES),
    "TIME,CH1,CH2,CH3,CH4",
)
CHANNELS = "CH1,CH2,CH3,CH4"

DEVICES = (
    device("one.lvm", "LabVIEW, one column of times", lvm("One")),
    device("no.lvm", "LabVIEW, no column of times", lvm("No"), implied=True),
    device("multi.lvm", "LabVIEW, a column of times for each channel", lvm("Multi")),
    device(
        "segments.lvm",
        "LabVIEW, a header in each segment, with comments",
        segments("One", restarting=False),
    ),
    device(
        "untimed.lvm",
        "LabVIEW, a header in each segment, no column of times",
        segments("No", restarting=False),
        implied=True,
    ),
    device(
        "moments.lvm",
        "LabVIEW, times of each segment from its own start",
        segments("One", restarting=True),
        implied=True,
    ),
    device(
        "yokogawa.csv",
        "Yokogawa",
        text(YOKOGAWA, [[None, *row[1:]] for row in rows()]),
        implied=True,
    ),
    device("tektronix.csv", "Tektronix", text(TEKTRONIX, rows())),
    device(
        "keysight.csv",
        "Keysight",
        text(("x-axis,1,2,3,4", "second,Volt,Ampere,rad/s,degC"), rows()),
        mapping=numbered(""),
    ),
    device(
        "rigol.csv",
        "Rigol",
        text(("Time(s),CH1(V),CH2(A),CH3(rad/s),CH4(degC)",), rows()),
        mapping={
            name: {"column": f"CH{k}({unit})"}
            for k, (name, unit) in enumerate(zip(list(RECORD)[1:], DEVICE_UNITS, strict=True), 1)
        },
    ),
    device(
        "sequence.csv",
        "Rigol, a clock in the header",
        text(
            (f"X,{CHANNELS},Start,Increment", "Sequence,Volt,Ampere,rad/s,degC,0.0e+00,1.0e-03"),
            [[k, *row[1:], None, None] for k, row in enumerate(rows())],
        ),
        mapping=numbered("CH"),
        implied=True,
    ),
    device(
        "picoscope.csv",
        "PicoScope",
        text(
            ("Time,Channel A,Channel B,Channel C,Channel D", "(s),(V),(A),(rad/s),(°C)", ""), rows()
        ),
        mapping=lettered(),
    ),
    device(
        "rows.csv",
        "a logger with rows of groups, names, units and types",
        text(
            (
                "Group,Electrical,Electrical,Shaft,Thermal",
                "Time," + ",".join(NAMES),
                "s,V,A,rad/s,degC",
                "double,double,double,double,double",
            ),
            rows(),
        ),
    ),
    device(
        "deutsch.csv",
        "a German logger",
        text(
            (
                "Zeit [s];Klemmenspannung [V];Ankerstrom [A];Motordrehzahl [rad/s];"
                "Wicklungstemperatur [°C]",
            ),
            [[str(cell).replace(".", ",") for cell in row] for row in rows()],
            ";",
        ),
    ),
)


def stamped(form: str, delimiter: str = ",") -> str:
    """The record with times of day of a form, in which {} stands for the milliseconds."""
    header = delimiter.join(["Timestamp", *list(RECORD)[1:]])
    stamps = [form.format(f"{round(float(str(row[0])) * 1000):03d}") for row in rows()]
    return text((header,), [[s, *r[1:]] for s, r in zip(stamps, rows(), strict=True)], delimiter)


CLOCKS = (
    device("iso.csv", "ISO dates", stamped("2026-03-01T08:00:00.{}Z")),
    device("zone.csv", "ISO dates with a zone", stamped("2026-03-01 08:00:00.{}+01:00")),
    device("tabs.txt", "dates between tabs", stamped("2026-03-01 08:00:00.{}", "\t")),
    device("clock.csv", "times of day", stamped("23:59:59.{}")),
    device("datum.csv", "German dates", stamped("01.03.2026 08:00:00,{}", ";")),
    device("slashes.csv", "dates of unknown order", stamped("03/01/2026 08:00:00.{}")),
)
REPEATED_LVM = 2 * lvm("One")
BROKEN_LVM = lvm("Multi", Delta_X="0.001,0.001,0.001,0.1")
