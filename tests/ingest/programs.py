"""Imitations of the exports of programs for drives, data bases and simulations."""

from __future__ import annotations

from tests.ingest.devices import DEVICE_UNITS, NAMES, device, text
from tests.ingest.writers import RECORD, XLSX, Specimen, mat, rows, workbook

__all__ = ["EPOCH_NS", "PROGRAMS", "epoch"]

EPOCH_NS = 1_772_352_000_000_000_000
_UNITS = list(zip(NAMES, DEVICE_UNITS, strict=True))
_MS = [round(1e3 * float(str(row[0]))) for row in rows()]
_MATRIX = list(RECORD.values())


def epoch(form: str) -> str:
    """The record with times since 1970, in a form of whole and fractional seconds."""
    header = ",".join(["Time", *list(RECORD)[1:]])
    stamps = [form.format(whole=EPOCH_NS // 10**9, ms=f"{ms:03d}") for ms in _MS]
    return text((header,), [[t, *row[1:]] for t, row in zip(stamps, rows(), strict=True)])


def _paired(*keys: str) -> list[str]:
    """Rows with the key before the value of each channel, as TwinCAT writes them."""
    values = {
        "Name": [f"Motor{name}" for name in NAMES],
        "Unit": list(DEVICE_UNITS),
        "SampleTime[ms]": ["1"] * 4,
        "Data-Type": ["REAL64"] * 4,
    }
    return ["\t".join(f"{key}\t{value}" for value in values[key]) for key in keys]


# Rows of TwinCAT Scope above one group of channels.
_SCOPE = (
    ("Starttime of export", ("132959733843760000", "Monday, 2 May 2022", "15:56:24.376")),
    ("Name", [f"Motor {name}" for name in NAMES]),
    ("SymbolComment", [""] * 4),
    ("Data-Type", ["LREAL"] * 4),
    ("SampleTime[ms]", ["1"] * 4),
    ("Offset", ["0"] * 4),
    ("BitMask", ["0xffffffffffffffff"] * 4),
    ("Unit", [f"{unit} (Quantity)" for unit in DEVICE_UNITS]),
    ("Unit ScaleFactor", ["1"] * 4),
)


def _influx() -> str:
    """Annotations, and a header again above each field."""
    lines = []
    for name, values in list(RECORD.items())[1:]:
        lines += ["#group,false,false,true,false", "#datatype,string,dateTime,double,string"]
        lines += ["#default,_result,,,", ",result,_time,_value,_field"]
        for ms, value in zip(_MS, values.tolist(), strict=True):
            lines.append(f",,2026-03-01T08:00:00.{ms:03d}Z,{value!r},{name}")
        lines.append("")
    return "\r\n".join(lines)


def _controldesk(name: str, path: str) -> dict[str, object]:
    """A recording of ControlDesk: axes X and curves Y, which state the number of their axis.

    The names of the curves and of their paths are forms of the name of the channel.
    """
    x = {"Name": "", "Type": "time", "Unit": "s", "Raster": "HostService"}
    axes = [{**x, "Data": _MATRIX[0][::5]}, {**x, "Data": _MATRIX[0]}]
    curves = [
        {
            "Name": name.format(channel),
            "Path": path.format(channel),
            "Unit": unit,
            "XIndex": 2.0,
            "Data": values,
        }
        for (channel, unit), values in zip(_UNITS, _MATRIX[1:], strict=True)
    ]
    return {"run_001": {"X": axes, "Y": curves, "Capture": "HostService", "Info": "bench 3"}}


def _catman() -> dict[str, object]:
    """Channels of catman: a vector, and a struct with its name and unit."""
    names = [("Time  1 - default sample rate", "s"), *_UNITS]
    found: dict[str, object] = {"File_Header": {"NumberOfChannels": "5", "Comment": ""}}
    for k, ((name, unit), values) in enumerate(zip(names, _MATRIX, strict=True), 1):
        found[f"Channel_{k}_Header"] = {"SignalName": name, "Unit": unit, "MaxLevel": "10"}
        found[f"Channel_{k}_Data"] = values[:, None]
    return found


def _inspector(*, grouped: bool) -> list[list[object]]:
    """Rows of the Simulation Data Inspector: names, a label in each cell below, samples.

    The time is in seconds without a unit; with `grouped`, it is repeated in front of the current.
    """
    names = ["time", *NAMES]
    labels: dict[str, list[str]] = {
        "Type: ": ["double"] * 4,
        "Unit: ": list(DEVICE_UNITS),
        "Interp: ": ["zoh", "linear", "linear", "linear"],
        "BlockPath: ": [f"motor/{name}" for name in NAMES],
        "PortIndex: ": ["1"] * 4,
    }
    lines: list[list[object]] = [list(names)]
    lines += [["", *(key + each for each in values)] for key, values in labels.items()]
    lines += rows()
    if not grouped:
        return lines
    return [[*line[:2], line[0], *line[2:]] for line in lines]


PROGRAMS = (
    device(
        "inspector.csv",
        "Simulation Data Inspector, two columns of times",
        text((), _inspector(grouped=True)),
    ),
    Specimen(
        "inspector.xlsx",
        "Simulation Data Inspector, a workbook",
        lambda p: workbook(p, {"Run 1": _inspector(grouped=False)}),
        XLSX,
    ),
    Specimen(
        "controldesk.mat",
        "dSPACE ControlDesk, a recording with two rasters",
        lambda p: mat(p, _controldesk("{}", "Platform()://Motor/{}")),
    ),
    Specimen(
        "ports.mat",
        "dSPACE ControlDesk, ports of one name, told apart by their paths",
        lambda p: mat(p, _controldesk("Out1", "Platform()://{}/Out1")),
        mapping={
            channel: {"column": f"Platform()://{name}/Out1"}
            for channel, name in zip([*RECORD][1:], NAMES, strict=True)
        },
    ),
    Specimen("catman.mat", "catman, a struct beside each channel", lambda p: mat(p, _catman())),
    device(
        "twincat_units.csv",
        "TwinCAT with the unit beside each channel",
        text(
            _paired("Name", "Data-Type", "SampleTime[ms]", "Unit"),
            [[c for x in row[1:] for c in (ms, x)] for ms, row in zip(_MS, rows(), strict=True)],
            "\t",
        ),
        implied=True,
    ),
    device(
        "twincat_group.csv",
        "TwinCAT, one time for the channels of one sample time",
        text(
            ["Name\tMotor", *("\t".join([key, *values]) for key, values in _SCOPE), ""],
            [[ms, *row[1:]] for ms, row in zip(_MS, rows(), strict=True)],
            "\t",
        ),
        implied=True,
    ),
    device(
        "controldesk.csv",
        "dSPACE ControlDesk, rows of several kinds, a label in front of the first sample",
        text(
            [
                "format;1",
                "path;;" + ";".join(f"Platform()://Model Root/{name}" for name in NAMES),
                "name;time;" + ";".join(NAMES),
                "description;;;;;",
                "unit;s;" + ";".join(DEVICE_UNITS),
                "raster" + ";HostService" * 5,
                "",
            ],
            [["trace_values" if not k else "", *row] for k, row in enumerate(rows())],
            ";",
        ),
    ),
    device(
        "paths.csv",
        "dSPACE ControlDesk, paths in place of names",
        text(
            ["path,time," + ",".join(f"Motor/{name}" for name in NAMES)]
            + ["unit,s," + ",".join(DEVICE_UNITS)],
            [["trace_values" if not k else "", *row] for k, row in enumerate(rows())],
        ),
    ),
    device(
        "picolog.csv",
        "PicoLog, averages, times of day without a name",
        text(
            ["," + ",".join(f"{name} Ave. ({unit})" for name, unit in _UNITS)],
            [
                [f"2026-03-01T08:00:00.{ms:03d}+01:00", *row[1:]]
                for ms, row in zip(_MS, rows(), strict=True)
            ],
        ),
    ),
    device(
        "epos.txt",
        "EPOS, actual values",
        text(
            [
                "Sampling Period: 1 ms",
                "Time [s]\t" + "\t".join(f"{n} actual value [{u}]" for n, u in _UNITS),
            ],
            rows(),
            "\t",
        ),
    ),
    device(
        "plecs.csv",
        "PLECS, the unit behind a slash",
        text(['"Time / s",' + ",".join(f'"{n} / {u}"' for n, u in _UNITS)], rows()),
    ),
    device(
        "arduino.txt",
        "Arduino, millis as the name of the time",
        text(["millis volts amps rad/s celsius"], [[k, *r[1:]] for k, r in enumerate(rows())], " "),
        implied=True,
    ),
    device("influx.csv", "InfluxDB, a header above each field", _influx()),
    Specimen(
        "yout.mat",
        "Simulink, tout and a matrix of outputs",
        lambda p: mat(
            p, {"tout": _MATRIX[0][:, None], "yout": list(zip(*_MATRIX[1:], strict=True))}
        ),
        mapping={
            "time_s": {"column": "tout", "unit": "s"},
            **{name: {"column": f"yout_{k}"} for k, name in enumerate(list(RECORD)[1:], 1)},
        },
    ),
    Specimen(
        "to_file.mat",
        "Simulink, a matrix with a row for each signal",
        lambda p: mat(p, {"data": _MATRIX}),
        mapping={name: {"column": f"data_{k}"} for k, name in enumerate(RECORD, 1)},
    ),
)
