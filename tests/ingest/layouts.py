"""Text files of different loggers with the same record."""

from __future__ import annotations

import re

import numpy as np

from tests.ingest.samples import CANONICAL, Dialect, record, write


def numbers(delimiter: str = ",", rows: int = 40) -> str:
    """Samples of the record without a header."""
    text = write(record(rows), Dialect(delimiter=delimiter)).decode()
    return text.split("\n", 1)[1]


LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\n\n"
    "Channels\t5\nSamples\t40\t40\t40\t40\t40\nX0\t0.0\t0.0\t0.0\t0.0\n"
    "Delta_X\t0.001\t0.001\t0.001\t0.001\n***End_of_Header***\n"
    "Time [s]\tVoltage [V]\tCurrent [A]\tSpeed [rad/s]\tTemperature [degC]\tComment\n"
)
SCOPE = (
    'Model,MSO44\n"Firmware, options",1.2\nRecord Length,40\nSample Interval,1e-3\n\n'
    "Time,Voltage,Current,Speed,Temperature\nsecond,Volt,Ampere,rad/s,°C\n"
)
SAVETXT = "# recorded on bench 3\n# " + ",".join(CANONICAL) + "\n"
THREE_ROWS = (
    "Time;Motor voltage;Motor current;Motor speed;Winding temperature;\n"
    "s;V;A;rad/s;degC;\nt;u_m;i_m;w_m;T_w;\n"
)
LAYOUTS = {
    "tabs": write(record(), Dialect("\t")),
    "semicolons and decimal commas": write(record(), Dialect(";", ",")),
    "tabs and decimal commas": write(record(), Dialect("\t", ",")),
    "byte order mark": write(record(), Dialect(encoding="utf-8-sig")),
    "UTF-16": write(record(), Dialect("\t", encoding="utf-16")),
    "UTF-16 of the other order": b"\xfe\xff" + write(record(), Dialect(encoding="utf-16-be")),
    "UTF-16 without byte order mark": write(record(), Dialect(encoding="utf-16-le")),
    "UTF-16 of the other order without mark": write(record(), Dialect(encoding="utf-16-be")),
    "Windows line ends": write(record(), Dialect(newline="\r\n")),
    "old Macintosh line ends": write(record(), Dialect(newline="\r")),
    "line ends converted twice": write(record(), Dialect(newline="\r\r\n")),
    "trailing delimiters": write(record(), Dialect(";", trailing=True)),
    "trailing delimiters below the header": write(record())
    .replace(b"\n", b",\n")
    .replace(b",\n", b"\n", 1),
    "quoted cells": write(record(), Dialect(quote='"')),
    "quoted decimal commas between commas": write(record(), Dialect(",", ",", quote='"')),
    "numbers with a decimal comma quoted": re.sub(
        rb"([^;\n]+,[^;\n]+)", rb'"\1"', write(record(), Dialect(";", ","))
    ).replace(b";", b","),
    "comments above": write(record(), Dialect(above=("# bench 3", "% motor 17", "// cold"))),
    "comment within": write(record()).replace(b"\n0.02,", b"\n# paused here\n0.02,"),
    "blank lines at the end": write(record(), Dialect(blank_lines_below=3)),
    "lines of commas at the end": write(record()) + b",,,,\n,,,,\n",
    "no final line end": write(record()).rstrip(b"\n"),
    "Excel's first line": write(record(), Dialect(";", above=("sep=;",))),
    "blanks": (" ".join(CANONICAL) + "\n" + numbers(" ")).encode(),
    "runs of blanks": (
        "  time [s]   voltage [V] current [A] speed [rad/s]  temperature [degC]\n"
        + numbers(" ").replace(" ", "    ")
    ).encode(),
    "blanks after commas": write(record()).replace(b",", b", "),
    "LabVIEW": (LABVIEW + numbers("\t")).encode(),
    "LabVIEW with an empty comment": (LABVIEW + numbers("\t").replace("\n", "\t\n")).encode(),
    "oscilloscope": (SCOPE + numbers()).encode(),
    "oscilloscope in the Windows encoding": (SCOPE + numbers()).encode("cp1252"),
    "header in a comment": (SAVETXT + numbers()).encode(),
    "three header rows": (THREE_ROWS + numbers(";").replace("\n", ";\n")).encode(),
    "header with a line break in a quoted cell": write(
        {f'"{name}\n"': column for name, column in record().items()}
    ),
    "columns in another order": write(dict(reversed(record().items()))),
    "columns that are not needed": write({"sample": np.arange(40.0), **record(), "x": np.ones(40)}),
    "a column of words": write(record()).replace(b"\n", b",ok\n").replace(b",ok", b",state", 1),
    "upper case": write({name.upper(): column for name, column in record().items()}),
}
