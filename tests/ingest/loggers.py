"""Imitations of the files of loggers, power analysers and serial monitors, by what is public."""

from __future__ import annotations

import datetime

from tests.ingest.devices import DEVICE_UNITS, NAMES, device, numbered, stamped, text
from tests.ingest.writers import RECORD, XLSX, Specimen, rows, workbook

__all__ = ["LOGGERS", "long", "stacked", "thousands", "with_affixes"]

_ALL = list(RECORD)[1:]
_MS = [round(1e3 * float(str(row[0]))) for row in rows()]
# The record begins 20 ms before a new second.
_SPLIT = [(f"08:00:{(980 + ms) // 1000:02d}", (980 + ms) % 1000) for ms in _MS]
_START = datetime.datetime(2026, 3, 1, 23, 59, 59, 980_000)
_CHANNELS = ("CH1", "CH2", "CH3", "CH4")
_BARE = {name: {"column": f"CH{k}", "scale": 1.0} for k, name in enumerate(_ALL, 1)}
_NAMED = {
    name: {"column": title, "unit": unit}
    for name, title, unit in zip(_ALL, NAMES, DEVICE_UNITS, strict=True)
}


def with_affixes(form: str, delimiter: str, header: tuple[str, ...] = ()) -> str:
    """The record with labels or units in its cells, in a form such as ``{label}:{value}``."""
    labels, units = ("t", "U", "I", "n", "T"), ("s", *DEVICE_UNITS)
    lines = [
        [
            form.format(label=label, value=cell, unit=unit)
            for label, cell, unit in zip(labels, row, units, strict=True)
        ]
        for row in rows()
    ]
    return text(header, lines, delimiter)


def long(header: str, form: str, units: tuple[str, ...] = DEVICE_UNITS) -> str:
    """The record with one signal per row, in a form of time, name, value and unit."""
    lines = [
        form.format(time=row[0], name=name, value=value, unit=unit, ms=f"{ms:03d}")
        for row, ms in zip(rows(), _MS, strict=True)
        for name, value, unit in zip(NAMES, row[1:], units, strict=True)
    ]
    return "\n".join([header, *lines, ""])


def stacked(*titles: str) -> str:
    """The record with each channel below its title lines."""
    blocks = [
        "\n".join([*titles, *map(repr, RECORD[name].tolist()), ""]).format(name=channel)
        for name, channel in zip(_ALL, _CHANNELS, strict=True)
    ]
    return "".join(blocks)


def thousands(group: str, decimal: str) -> str:
    """The record with a speed in deg/s whose numbers have a sign between thousands."""
    lines = []
    for k, row in enumerate(rows()):
        number = f"{1020.5 - k:,.1f}".replace(",", "g").replace(".", decimal).replace("g", group)
        cells = [str(cell).replace(".", decimal) for cell in row]
        lines.append(";".join([*cells[:3], number, cells[4]]))
    return "\n".join(["time_s;voltage_V;current_A;speed_deg_s;temperature_degC", *lines, ""])


def _times(form: str) -> list[list[object]]:
    """Rows with the second of the day and its fraction in two columns."""
    return [
        [f"2026/03/01 {clock}", form.format(ms=ms, fraction=f"{ms / 1000:.3f}"), *row[1:]]
        for (clock, ms), row in zip(_SPLIT, rows(), strict=True)
    ]


def _wide(first: list[object]) -> list[list[object]]:
    return [[time, *row[1:]] for time, row in zip(first, rows(), strict=True)]


def _stamped(form: str, delimiter: str) -> str:
    """Lines of the record, the header among them, behind the time at which each arrived."""
    lines = [
        delimiter.join(map(str, cells))
        for cells in [list[object](_ALL), *(row[1:] for row in rows())]
    ]
    return "\n".join([form.format(ms=max(k - 1, 0)) + line for k, line in enumerate(lines)] + [""])


def _signed(value: object) -> str:
    """Number with blanks between its sign and its digits."""
    return f"{'-' if str(value).startswith('-') else '+'}   {str(value).lstrip('-')}"


_LONG = [
    [row[0], name, value, unit]
    for row in rows()
    for name, value, unit in zip(NAMES, row[1:], DEVICE_UNITS, strict=True)
]
_UNITS_ABOVE = [f"{name} [{unit}]" for name, unit in zip(NAMES, DEVICE_UNITS, strict=True)]
_LATER = [datetime.timedelta(milliseconds=ms) for ms in _MS]


def _hicorder() -> tuple[str, ...]:
    """Header of a text file of a HIOKI Memory HiCorder with scaling and logic channels.

    The layout is that of the appendix on text files of the manual of the MR8880.
    """
    logic = ("LA1", "LA2")
    settings = {
        "CH": ("CH1", "CH2", "CH3", "CH4", *logic),
        "Mode": ("DC", "DC", "DC", "DC", "LOGIC", "LOGIC"),
        "Range": ("20V", "2V", "5V", "5V", "-", "-"),
        "Comment": (*NAMES, "", ""),
        "Scaling": ("Off", "On", "On", "On", "-", "-"),
        "Ratio": (" 1.00000E+00",) * 4 + ("-", "-"),
        "Offset": (" 0.00000E+00",) * 4 + ("-", "-"),
        "Time": (*(f"CH{k}[{unit}]" for k, unit in enumerate(DEVICE_UNITS, 1)), *logic),
    }
    titles = ("File name", "WAVE0001.CSV", "V1.00"), ("Title comment", "")
    lines = [*titles, *((key, *cells) for key, cells in settings.items())]
    return tuple(",".join(f'"{cell}"' for cell in line) + "," for line in lines)


LOGGERS = (
    device(
        "hicorder.csv",
        "HIOKI Memory HiCorder, comments as the names of the channels",
        text(_hicorder(), [[*row, 1, 0, None] for row in rows()]),
    ),
    device(
        "yokogawa_wt.csv",
        "Yokogawa WT, milliseconds in a column of their own",
        text(
            ("Model,WT1800E", "", f"Store No.,Date,Time,Millisecond,{','.join(_UNITS_ABOVE)}"),
            [[k, "2026/03/01", *_SPLIT[k], *row[1:]] for k, row in enumerate(rows())],
        ),
    ),
    device(
        "graphtec.csv",
        "Graphtec, title lines, units and alarms",
        text(
            (
                "Sampling interval,1ms",
                'CH1,"CH 1",DC,20V,Off',
                "Number,Date&Time,ms,CH1,CH2,CH3,CH4,Alarm1-4",
                "NO.,Time,ms,V,V,V,V,A1234",
            ),
            [[k, *row, "LLLL"] for k, row in enumerate(_times("{ms}"))],
        ),
        mapping=_BARE,
    ),
    device(
        "fraction.csv",
        "a fraction of the second in a column of its own",
        text((f"Time,Fraction,{','.join(_UNITS_ABOVE)}",), _times("{fraction}")),
    ),
    device(
        "owon.csv",
        "OWON, the interval of each channel in a title line",
        text(
            (
                f"Channel :,{','.join(_CHANNELS)}",
                "Time interval :,1.00000mS,1.00000mS,1.00000mS,1.00000mS",
                "",
                f"index,{','.join(f'{c}_Voltage(V)' for c in _CHANNELS)}",
            ),
            [[k, *row[1:]] for k, row in enumerate(rows())],
        ),
        mapping={
            n: {"column": f"{c}_Voltage(V)", "scale": 1.0}
            for n, c in zip(_ALL, _CHANNELS, strict=True)
        },
        implied=True,
    ),
    device(
        "rate.csv",
        "a sample rate in a comment, no time",
        text(("# Sample rate: 1.0 kHz", ",".join(_UNITS_ABOVE)), [row[1:] for row in rows()]),
        implied=True,
    ),
    device(
        "hantek.csv",
        "Hantek, the clock in a comment, columns without names",
        text(("# CLOCK=1.00mS", "# UNITS:V"), [row[1:] for row in rows()]),
        mapping=numbered("column "),
        implied=True,
    ),
    device(
        "stacked.txt",
        "Hantek, channels one below another",
        stacked("#CHANNEL:{name}", "#CLOCK=1.00mS", "#SIZE=40", "#UNITS:V", ""),
        mapping=_BARE,
        implied=True,
    ),
    device(
        "stacked_owon.csv",
        "OWON, channels one below another, units in brackets",
        stacked("Model,X", "Channel : {name},", "Time interval : ,1.00000mS,", "Unit : (V)"),
        mapping=_BARE,
        implied=True,
    ),
    device(
        "blank_time.csv",
        "Rigol, a blank time and the clock in the header",
        text(
            (f"Time(s),{','.join(_UNITS_ABOVE)},t0 = 0.0e+00s, tInc = 1.0e-03s,",),
            [[None, *row[1:], None] for row in rows()],
        ),
        implied=True,
    ),
    device(
        "long.csv",
        "CANoe, one signal per row with its unit",
        long("Time[s],Name,Value,Unit", "{time},Motor::{name},{value},{unit}"),
    ),
    device(
        "unitless.csv",
        "one signal per row, no units",
        long("time;signal name;value", "{time};{name};{value}"),
        mapping={"time_s": {"column": "time", "unit": "s"}, **_NAMED},
    ),
    device(
        "wincc.csv",
        "WinCC, times with a fraction, decimal commas",
        long(
            '"VarName";"TimeString";"VarValue";"Validity"',
            '"{name}";"01.03.2026 08:00:00,{ms}";{value};1',
        ),
        mapping=_NAMED,
    ),
    device(
        "monitor.txt",
        "serial monitor of Arduino, the time of arrival in front of each line",
        _stamped("08:00:00.{ms:03d} -> ", ","),
    ),
    device(
        "platformio.txt",
        "serial monitor of PlatformIO, cells between blanks",
        _stamped("08:00:00.{ms:03d} > ", " "),
    ),
    device(
        "teraterm.log",
        "Tera Term, date and time in brackets, cells between tabs",
        _stamped("[2026-03-01 08:00:00.{ms:03d}] ", "\t"),
    ),
    device(
        "signs.csv",
        "Graphtec, signs apart from their numbers",
        text(
            (f"NO.,Time,ms,{','.join(_UNITS_ABOVE)},Alarm1-4",),
            [
                [k, *_times("{ms:3d}")[k][:2], *map(_signed, row[1:]), "LLLL"]
                for k, row in enumerate(rows())
            ],
        ),
    ),
    device("months.csv", "MATLAB dates", stamped("01-Mar-2026 08:00:00.{}")),
    device("halves.csv", "Dewesoft dates with AM and PM", stamped("3/1/2026 11:59:59.{} PM")),
    device("elapsed.csv", "minutes and seconds", stamped("00:01.{}")),
    device("hours.csv", "HIOKI, elapsed hours", stamped("00000:00:00.{}")),
    device(
        "dated.csv",
        "HIOKI, date, time and elapsed time",
        text(
            (f"Date,Time,ETime,{','.join(_UNITS_ABOVE)}",),
            [
                ["2026/03/01", f"08:00:00.{ms:03d}", f"00000:00:00.{ms:03d}", *row[1:]]
                for ms, row in zip(_MS, rows(), strict=True)
            ],
        ),
    ),
    device(
        "durations.csv",
        "MATLAB, durations in seconds",
        text((",".join(["Time", *_ALL]),), _wide([f"{row[0]} sec" for row in rows()])),
    ),
    device(
        "tagged.csv",
        "the name of the device in front of each line, as a database of time series exports it",
        text((",".join(["name", "Time [s]", *_ALL]),), [["motor", *row] for row in rows()]),
    ),
    device(
        "units.csv",
        "a unit behind each number",
        with_affixes("{value} {unit}", ",", ("Time,Voltage,Current,Speed,Temperature",)),
    ),
    device(
        "turns.csv",
        "a unit that begins with a number",
        with_affixes("{value} {unit}", ";", ("Zeit;Spannung;Strom;Drehzahl;Temperatur",)).replace(
            "rad/s", "1/min"
        ),
        mapping={"speed_rad_s": {"column": "Drehzahl", "unit": "rad/s"}},
    ),
    device(
        "plotter.txt",
        "labels of a serial plotter, below lines of another kind",
        "ready\n10 20 30 40 50\nbooting the motor board now\n"
        + with_affixes("{label}:{value}", " "),
        mapping={
            name: {"column": label, "unit": unit}
            for name, label, unit in zip(
                RECORD, ("t", "U", "I", "n", "T"), ("s", *DEVICE_UNITS), strict=True
            )
        },
    ),
    device(
        "blanks.txt",
        "labels with a blank behind them",
        with_affixes("{label}_{unit}: {value}", " ").replace("rad/s", "rad_s"),
        mapping={
            name: {"column": f"{label}_{unit}"}
            for name, label, unit in zip(
                RECORD, "tUInT", ("s", *DEVICE_UNITS[:2], "rad_s", DEVICE_UNITS[3]), strict=True
            )
        },
    ),
    device(
        "labels.txt",
        "labels with a blank and units",
        with_affixes("{label}: {value} {unit}", ", "),
    ),
    Specimen(
        "long.xlsx",
        "one signal per row of a sheet",
        lambda p: workbook(p, {"Run": [["Time [s]", "Signal", "Value", "Unit"], *_LONG]}),
        XLSX,
    ),
    Specimen(
        "long_utf16.csv",
        "one signal per row, UTF-16 without a byte order mark",
        lambda p: p.write_bytes(
            long("Time[s];Name;Value;Unit", "{time};{name};{value};{unit}").encode("utf-16-le")
        ),
    ),
    Specimen(
        "durations.xlsx",
        "durations of a workbook",
        lambda p: workbook(p, {"Run": [["Time", *_ALL], *_wide(list(_LATER))]}),
        XLSX,
    ),
    Specimen(
        "midnight.xlsx",
        "dates of a workbook, one of them at midnight",
        lambda p: workbook(p, {"Run": [["Time", *_ALL], *_wide([_START + t for t in _LATER])]}),
        XLSX,
    ),
)
