"""Imitations of the files of oscilloscopes, drives and controllers, by what is public of them."""

from __future__ import annotations

from pathlib import Path

from tests.ingest.devices import CHANNELS, DEVICE_UNITS, NAMES, device, numbered, text
from tests.ingest.writers import RECORD, rows

__all__ = ["SCOPES", "SIDES", "beside"]

_ALL = list(RECORD)[1:]
_SETTINGS = (
    "Record Length,4.0e+01,",
    "Sample Interval,1.0e-03,",
    "Trigger Point,2.0e+01,",
    ",,",
    "Source,CH{},",
    "Vertical Units,V,",
    "Vertical Scale,5.0e+00,",
    "Horizontal Units,s,",
    "Probe Atten,1.0e+01,",
    "Model Number,TDS2024B,",
)
_QUOTED = (
    '"Record Length",40,"Points"',
    '"Sample Interval",0.001,"s"',
    '"Trigger Point",20,"Samples"',
    ",,",
    '"Horizontal Offset",0.0,"s"',
)
SIDES = {"settings with a source": _SETTINGS, "quoted settings without a source": _QUOTED}
"""Settings of Tektronix TDS1000/2000 and TBS, and of TDS3000."""


def beside(path: Path, channel: int, settings: tuple[str, ...], end: str = "") -> Path:
    """Write time and one channel of the record, with settings left of the first samples."""
    left = [one.format(channel) for one in settings]
    cells = [(row[0], row[channel]) for row in rows()]
    lines = [
        f"{left[k] if k < len(left) else ',,'},   {time},  {value}{end}"
        for k, (time, value) in enumerate(cells)
    ]
    path.write_text("\r\n".join([*lines, ""]))
    return path


def each(title: str) -> dict[str, dict[str, str]]:
    """Mapping of channels whose titles have a number in place of {}."""
    return {
        name: {"column": title.format(k), "unit": unit}
        for k, (name, unit) in enumerate(zip(_ALL, DEVICE_UNITS, strict=True), 1)
    }


VOLTS = ",Volt,Ampere,rad/s,degC"
TWINCAT = (
    "Name\tScope\t",
    "File\tC:\\bench.tcscopex",
    "",
    *(
        "\t".join(f"{key}\t{value}" for value in values)
        for key, values in (
            ("Name", NAMES),
            ("SymbolName", [f"MAIN.{name}" for name in NAMES]),
            ("SampleTime[ms]", ("1",) * 4),
            ("BitMask", ("0x0",) * 4),
        )
    ),
    "",
)
_PAIRS = [[c for x in r[1:] for c in (round(1e3 * float(str(r[0]))), x)] for r in rows()]

SCOPES = (
    device(
        "short.csv",
        "Rigol, rows shorter than their header",
        text(
            (f"X,{CHANNELS},Start,Increment,", f"Sequence{VOLTS},0.0e+00,1.0e-03"),
            [[k, *row[1:], None] for k, row in enumerate(rows())],
        ),
        mapping=numbered("CH"),
        implied=True,
    ),
    device(
        "increment.csv",
        "Rigol, the clock as equations in the header",
        text(
            ("CH1(V),CH2(A),CH3(rad/s),CH4(degC),t0 =0.0e+00, tInc = 1.0e-03,",),
            [[*row[1:], None] for row in rows()],
        ),
        mapping={
            n: {"column": f"CH{k}({u})"}
            for k, (n, u) in enumerate(zip(_ALL, DEVICE_UNITS, strict=True), 1)
        },
        implied=True,
    ),  # fmt: skip
    device(
        "bracketed.csv",
        "Rigol, channels in brackets above their units",
        text(
            ("Time,X(CH1),X(CH2),X(CH3),X(CH4),", f"Second{VOLTS},"), [[*r, None] for r in rows()]
        ),
        mapping={name: {"column": f"X(CH{k})"} for k, name in enumerate(_ALL, 1)},
    ),
    device(
        "siglent.csv",
        "Siglent, units of all channels in one cell",
        text(
            (
                "Vertical Units,CH1:V CH2:A CH3:V CH4:V",
                "Horizontal Units,s",
                f"Source,{CHANNELS}",
                f"Second{VOLTS}",
            ),
            rows(),
        ),
        mapping=numbered("CH"),
    ),
    device(
        "rohde.csv",
        "Rohde & Schwarz, a time without a name",
        text(("in s," + ",".join(f"CH{k} in {u}" for k, u in enumerate(DEVICE_UNITS, 1)),), rows()),
        mapping={
            n: {"column": f"CH{k} in {u}"}
            for k, (n, u) in enumerate(zip(_ALL, DEVICE_UNITS, strict=True), 1)
        },
    ),  # fmt: skip
    device(
        "singular.csv",
        "Rohde & Schwarz RTH, units in title lines",
        text(
            ("Horizontal Unit;s", "Vertical Unit;" + ";".join(DEVICE_UNITS), "TIME;C1;C2;C3;C4"),
            rows(),
            ";",
        ),
        mapping=numbered("C"),
    ),
    device(
        "capital.csv",
        "Tektronix DPO, seconds as S",
        text(
            ("Horizontal Units,S,", "Vertical Units," + ",".join(DEVICE_UNITS), f"TIME,{CHANNELS}"),
            rows(),
        ),
        mapping=numbered("CH"),
    ),
    device(
        "hashed.csv",
        "Tektronix MDO, all title lines as comments",
        text(
            (
                "#Horizontal Units,s,,,",
                "#Sample Interval,1e-03,,,",
                "#Vertical Units," + ",".join(DEVICE_UNITS),
                "#Label," + ",".join(NAMES),
                f"#TIME,{CHANNELS}",
            ),
            rows(),
        ),
    ),
    device(
        "keyless.csv",
        "Yokogawa, no cell for the keys in the samples",
        text(
            (
                "TraceName," + ",".join(NAMES),
                "VUnit," + ",".join(DEVICE_UNITS),
                "HResolution,1e-3,1e-3,1e-3,1e-3",
                "HUnit,s,s,s,s",
                "",
            ),
            [row[1:] for row in rows()],
        ),
        implied=True,
    ),
    device(
        "twincat.csv",
        "TwinCAT, a time and a value of each channel, EOF at the end",
        text(TWINCAT, _PAIRS, "\t") + "EOF\r\n",
        mapping={
            n: {"column": t, "unit": u} for n, t, u in zip(_ALL, NAMES, DEVICE_UNITS, strict=True)
        },
        implied=True,
    ),  # fmt: skip
    device(
        "tags.csv",
        "Siemens, tags in quotation marks within a cell",
        text(
            ("Zeit [s];" + ";".join(f'"Drive".x{k} [{u}]' for k, u in enumerate(DEVICE_UNITS)),),
            rows(),
            ";",
        ),
        mapping={
            n: {"column": f'"Drive".x{k} [{u}]'}
            for k, (n, u) in enumerate(zip(_ALL, DEVICE_UNITS, strict=True))
        },
    ),  # fmt: skip
    device(
        "saleae.csv",
        "Saleae, channels without units",
        text(("Time [s]," + ",".join(f"Channel {k}" for k in (1, 2, 3, 4)),), rows()),
        mapping=each("Channel {}"),
    ),
)
