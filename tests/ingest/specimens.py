"""Run files of every format, made by the formats' own writers; all hold the record of `samples`."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.ingest.samples import record, write

Array = NDArray[np.float64]

RECORD = record()
UNITS = ("s", "V", "A", "rad/s", "degC")
NAMES = ("time", "voltage", "current", "speed", "temperature")


@dataclass(frozen=True)
class Specimen:
    """A file of one format.

    Args:
        name: File name.
        title: What is particular about the file.
        write: Function that writes it to a path.
        needs: Modules without which it cannot be written or read.
        mapping: Mapping for its reading.
        is_clock_implied: True if the file holds an increment in place of times, whose multiples
            differ from the times of the record in the last bit.
    """

    name: str
    title: str
    write: Callable[[Path], object]
    needs: tuple[str, ...] = ()
    mapping: Mapping[str, object] | None = None
    is_clock_implied: bool = False

    def made(self, folder: Path) -> Path:
        """Write the file into a folder, or skip the test without the packages."""
        for module in self.needs:
            pytest.importorskip(module)
        path = folder / self.name
        self.write(path)
        return path


def rows() -> list[list[object]]:
    """Samples of the record."""
    return [list(row) for row in zip(*(c.tolist() for c in RECORD.values()), strict=True)]


def workbook(path: Path, sheets: Mapping[str, list[list[object]]]) -> None:
    """Write a workbook with openpyxl."""
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for title, lines in sheets.items():
        sheet = book.create_sheet(title)
        for line in lines:
            sheet.append(line)
    book.save(path)


def parquet(path: Path, columns: Mapping[str, object], units: Mapping[str, str]) -> None:
    """Write a Parquet file with pyarrow, with units in the metadata of the fields."""
    import pyarrow
    from pyarrow import parquet as library

    arrays = [pyarrow.array(values) for values in columns.values()]
    fields = [
        pyarrow.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    library.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), path)


def compressed(write_inner: Callable[[Path], object]) -> Callable[[Path], None]:
    """Writer of the same file, compressed."""

    def written(path: Path) -> None:
        inner = path.with_suffix(".inner")
        write_inner(inner)
        path.write_bytes(gzip.compress(inner.read_bytes()))

    return written


Channel = tuple[str, str, Array]
"""Name, unit and samples of a channel."""


def tdms(
    path: Path, groups: Mapping[str, Sequence[Channel]], properties: Mapping[str, object]
) -> None:
    """Write a TDMS file with npTDMS, with properties of every channel."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject(group, name, values, {"unit_string": unit, **properties})
                for group, channels in groups.items()
                for name, unit, values in channels
            ]
        )


def mdf(
    path: Path,
    groups: Mapping[str, tuple[Array, Sequence[Channel]]],
    version: str,
) -> None:
    """Write an MDF file with asammdf: each group has its times and its channels."""
    from asammdf import MDF, Signal

    file = MDF(version=version)
    for title, (time, channels) in groups.items():
        file.append(
            [Signal(v, time, name=name, unit=unit) for name, unit, v in channels],
            acq_name=title,
            comment=title,
        )
    file.save(path, overwrite=True)
    file.close()


XLSX = ("openpyxl", "python_calamine")
PARQUET = ("pyarrow",)
TDMS = ("nptdms",)
MDF = ("asammdf",)
CHANNELS: list[Channel] = list(zip(NAMES, UNITS, RECORD.values(), strict=True))
TIME, VOLTAGE, CURRENT, SPEED, TEMPERATURE = CHANNELS
STEPS = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
CANONICAL_SHEET: list[list[object]] = [list(RECORD), *rows()]
NAMED: dict[str, object] = dict(zip(NAMES, RECORD.values(), strict=True))
NAMED_UNITS = dict(zip(NAMES, UNITS, strict=True))


def dated() -> dict[str, object]:
    """The record with the times as dates in nanoseconds."""
    ticks = np.round(RECORD["time_s"] * 1e9).astype("timedelta64[ns]")
    return {**RECORD, "time_s": None} | {
        "time": np.datetime64("2026-03-01T08:00:00", "ns") + ticks,
        **{name: values for name, values in RECORD.items() if name != "time_s"},
    }


def without_blank(columns: Mapping[str, object]) -> dict[str, object]:
    """Columns that have values."""
    return {name: values for name, values in columns.items() if values is not None}


WORKBOOKS = (
    Specimen(
        "run.xlsx",
        "one sheet, canonical names",
        lambda p: workbook(p, {"Sheet1": CANONICAL_SHEET}),
        XLSX,
    ),
    Specimen(
        "titled.xlsx",
        "title lines, a row of units, a sheet of notes and an empty one",
        lambda p: workbook(
            p,
            {
                "Notes": [["Motor 17"], ["bench", 3]],
                "Empty": [],
                "Run": [["Test bench 3"], [], list(NAMES), list(UNITS), *rows()],
            },
        ),
        XLSX,
    ),
    Specimen(
        "two.xlsx",
        "two runs, one of them chosen",
        lambda p: workbook(
            p,
            {"Cold": [list(RECORD), *[r[::-1] for r in rows()]], "Hot": CANONICAL_SHEET},
        ),
        XLSX,
        {"table": "Hot"},
    ),
)

COLUMNAR = (
    Specimen("run.parquet", "canonical names", lambda p: parquet(p, RECORD, {}), PARQUET),
    Specimen(
        "units.parquet",
        "units in the metadata of the fields",
        lambda p: parquet(p, NAMED, NAMED_UNITS),
        PARQUET,
    ),
    Specimen("dates.parquet", "dates", lambda p: parquet(p, without_blank(dated()), {}), PARQUET),
)

COMPRESSED = (
    Specimen(
        "run.csv.gz", "compressed text", lambda p: p.write_bytes(gzip.compress(write(RECORD)))
    ),
    Specimen(
        "run.parquet.gz",
        "compressed Parquet",
        compressed(lambda p: parquet(p, RECORD, {})),
        PARQUET,
    ),
)

MEASUREMENTS = (
    Specimen(
        "waveform.tdms",
        "waveforms with an increment",
        lambda p: tdms(p, {"log": CHANNELS[1:]}, STEPS),
        TDMS,
        is_clock_implied=True,
    ),
    Specimen("time.tdms", "a channel of the time", lambda p: tdms(p, {"log": CHANNELS}, {}), TDMS),
    Specimen(
        "groups.tdms",
        "two groups with a time each",
        lambda p: tdms(p, {"electrical": CHANNELS[:3], "shaft": [TIME, SPEED, TEMPERATURE]}, {}),
        TDMS,
    ),
    Specimen(
        "chosen.tdms",
        "two runs, one of them chosen",
        lambda p: tdms(p, {"run 1": [TIME, VOLTAGE, SPEED, CURRENT], "run 2": CHANNELS}, {}),
        TDMS,
        {"table": "run 2"},
    ),
    Specimen(
        "run.tdms.gz", "compressed", compressed(lambda p: tdms(p, {"log": CHANNELS}, {})), TDMS
    ),
    Specimen(
        "run.mdf",
        "version 3, units in the conversions",
        lambda p: mdf(p, {"log": (TIME[2], CHANNELS[1:])}, "3.30"),
        MDF,
    ),
    Specimen(
        "run.mf4",
        "version 4, names with a device",
        lambda p: mdf(
            p, {"log": (TIME[2], [(f"{n}\\XCP:1", u, v) for n, u, v in CHANNELS[1:]])}, "4.10"
        ),
        MDF,
    ),
    Specimen(
        "groups.mf4",
        "a group for each channel",
        lambda p: mdf(p, {name: (TIME[2], [(name, u, v)]) for name, u, v in CHANNELS[1:]}, "4.20"),
        MDF,
    ),
    Specimen(
        "repeated.mf4",
        "a setpoint of the same name in another group, chosen by its group",
        lambda p: mdf(
            p,
            {"log": (TIME[2], CHANNELS[1:]), "command": (TIME[2], [("speed", "rpm", TIME[2])])},
            "4.10",
        ),
        MDF,
        {"speed_rad_s": {"column": "log/speed"}},
    ),
)

SPECIMENS = (*WORKBOOKS, *COLUMNAR, *COMPRESSED, *MEASUREMENTS)
