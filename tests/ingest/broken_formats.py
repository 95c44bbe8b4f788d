"""Files of binary formats that are refused, with the expected error of each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification import errors
from tests.ingest.broken_devices import BROKEN_DEVICES
from tests.ingest.broken_matlab import BROKEN_HDF5, BROKEN_MATLAB
from tests.ingest.matlab_logs import BROKEN_OBJECTS
from tests.ingest.writers import (
    CANONICAL_SHEET,
    CHANNELS,
    CURRENT,
    MDF,
    NAMED,
    NAMED_UNITS,
    PARQUET,
    RECORD,
    SPEED,
    STEPS,
    TDMS,
    TEMPERATURE,
    TIME,
    VOLTAGE,
    XLSX,
    broken,
    cut,
    mdf,
    parquet,
    rows,
    tdms,
    workbook,
)

__all__ = ["BROKEN"]


def with_cell(row: int, column: int, value: object) -> list[list[object]]:
    """Canonical sheet with one cell replaced; both are counted from 1."""
    sheet = [list(line) for line in CANONICAL_SHEET]
    sheet[row - 1][column - 1] = value
    return sheet


def two_runs(path: Path) -> None:
    """Workbook with two complete sheets."""
    workbook(path, {"Cold": CANONICAL_SHEET, "Hot": CANONICAL_SHEET})


def feather(path: Path) -> None:
    """Write an Arrow file."""
    import pyarrow
    from pyarrow import feather as library

    library.write_feather(pyarrow.table(RECORD), path)


BROKEN_WORKBOOKS = (
    broken(
        "two.xlsx",
        "two runs",
        two_runs,
        errors.AmbiguousTable,
        "the sheets 'Cold', 'Hot' all contain a run",
        '{"table": "Cold"}',
        needs=XLSX,
    ),
    broken(
        "two.xlsx",
        "a sheet that does not exist",
        two_runs,
        errors.MappingError,
        "there is no sheet 'Warm'",
        "'Cold', 'Hot'",
        needs=XLSX,
        mapping={"table": "Warm"},
    ),
    broken(
        "run.xlsx",
        "text in a cell",
        lambda p: workbook(p, {"Run": with_cell(7, 3, "off")}),
        errors.NotANumber,
        "row 7, column current_A",
        "'off' is not a number",
        needs=XLSX,
    ),
    broken(
        "run.xlsx",
        "an error of a formula",
        lambda p: workbook(p, {"Run": with_cell(5, 2, "#N/A")}),
        errors.MissingValue,
        "row 5, column voltage_V",
        "the cell is blank",
        needs=XLSX,
    ),
    broken(
        "run.xlsx",
        "a blank cell",
        lambda p: workbook(p, {"Run": with_cell(9, 4, None)}),
        errors.MissingValue,
        "row 9, column speed_rad_s",
        "the cell is blank",
        needs=XLSX,
    ),
    broken(
        "run.xlsx",
        "no speed in any sheet",
        lambda p: workbook(
            p,
            {
                "A": [["time_s", "voltage_V"], *[r[:2] for r in rows()]],
                "B": [["time_s", "voltage_V", "current_A"], *[r[:3] for r in rows()]],
            },
        ),
        errors.MissingColumn,
        "no column for speed_rad_s",
        "the sheet 'B', the file also has 'A'",
        needs=XLSX,
    ),
    broken(
        "run.xlsx",
        "prose",
        lambda p: workbook(p, {"A": [["Dear colleague"]], "B": []}),
        errors.NoTable,
        "no line with numbers",
        needs=XLSX,
    ),
    broken(
        "run.xlsx",
        "half of a workbook",
        cut(lambda p: workbook(p, {"Run": CANONICAL_SHEET}), 0.5),
        errors.DamagedFile,
        "looks like a workbook",
        "export the file again",
        needs=XLSX,
    ),
    broken(
        "run.xls",
        "signature of an old workbook alone",
        lambda p: p.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600)),
        errors.DamagedFile,
        "looks like a workbook",
        needs=("python_calamine",),
    ),
    broken(
        "run.csv",
        "a mapping of a table in a text file",
        lambda p: p.write_text("time_s,voltage_V,current_A,speed_rad_s\n0,1,2,3\n1,2,3,4\n"),
        errors.MappingError,
        "names the table 'Run'",
        "a single table",
        mapping={"table": "Run"},
    ),
)

BROKEN_COLUMNAR = (
    broken(
        "run.parquet",
        "three faults in one file",
        lambda p: parquet(
            p, NAMED, {**NAMED_UNITS, "voltage": "mph", "current": "rpm", "time": ""}
        ),
        errors.RunFileError,
        "column time: the column may be time_s, but has no unit",
        "'mph' is unknown",
        "rpm is a unit of speed",
        needs=PARQUET,
    ),
    broken(
        "run.parquet",
        "a column of texts",
        lambda p: parquet(p, {**RECORD, "current_A": ["off"] * 40}, {}),
        errors.NotANumber,
        "column current_A",
        "expected one number for each sample",
        needs=PARQUET,
    ),
    broken(
        "run.parquet",
        "a missing value",
        lambda p: parquet(p, {**RECORD, "speed_rad_s": [None, *[1.5] * 39]}, {}),
        errors.MissingValue,
        "row 1, column speed_rad_s",
        needs=PARQUET,
    ),
    broken(
        "run.parquet",
        "an infinity",
        lambda p: parquet(p, {**RECORD, "voltage_V": [*[1.5] * 39, np.inf]}, {}),
        errors.NotFinite,
        "row 40, column voltage_V",
        needs=PARQUET,
    ),
    broken(
        "run.parquet",
        "without its end",
        cut(lambda p: parquet(p, RECORD, {}), 0.9),
        errors.DamagedFile,
        "looks like a Parquet file",
        needs=PARQUET,
    ),
    broken(
        "run.feather",
        "Arrow",
        feather,
        errors.UnsupportedContent,
        "an Arrow or Feather file",
        "write Parquet instead",
        needs=PARQUET,
    ),
)

BROKEN_MEASUREMENTS = (
    broken(
        "run.tdms",
        "a scaling that npTDMS leaves out",
        lambda p: tdms(
            p,
            {"log": CHANNELS[1:]},
            {**STEPS, "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Reciprocal"},
        ),
        errors.UnsupportedContent,
        "column voltage",
        "the scaling 'Reciprocal' is not supported",
        needs=TDMS,
    ),
    broken(
        "run.tdms",
        "cut in the middle of the channels",
        cut(lambda p: tdms(p, {"log": CHANNELS[1:]}, STEPS), 0.5),
        errors.MissingColumn,
        "no column for speed_rad_s",
        "the end is missing, probably by a loss of power",
        needs=TDMS,
    ),
    broken(
        "run.tdms",
        "no numbers",
        lambda p: p.write_bytes(b"TDSm" + bytes(24)),
        errors.RunFileError,
        "run.tdms: ",
        needs=TDMS,
    ),
    broken(
        "run.tdms",
        "neither increment nor time",
        lambda p: tdms(p, {"log": CHANNELS[1:]}, {}),
        errors.MissingColumn,
        "no column for time_s",
        needs=TDMS,
    ),
    broken(
        "run.tdms",
        "two complete runs",
        lambda p: tdms(p, {"cold": CHANNELS, "hot": CHANNELS}, {}),
        errors.AmbiguousTable,
        "the groups 'cold', 'hot' all contain a run",
        needs=TDMS,
    ),
    broken(
        "run.tdms",
        "an unknown and a missing unit",
        lambda p: tdms(
            p,
            {"log": [TIME, ("voltage", "Vrms", VOLTAGE[2]), ("current", "", CURRENT[2]), SPEED]},
            {},
        ),
        errors.UnknownUnit,
        "the unit 'Vrms' is unknown",
        "the column may be current_A, but has no unit",
        needs=TDMS,
    ),
    broken(
        "run.mf4",
        "a damaged header",
        lambda p: p.write_bytes(b"MDF     4.10" + bytes(200)),
        errors.DamagedFile,
        "looks like an MDF measurement file",
        needs=MDF,
    ),
    broken(
        "run.mf4",
        "half of the file",
        cut(lambda p: mdf(p, {"log": (TIME[2], CHANNELS[1:])}, "4.10"), 0.5),
        errors.DamagedFile,
        "copy or export the file again",
        needs=MDF,
    ),
    broken(
        "run.mf4",
        "times that repeat",
        lambda p: mdf(p, {"log": (np.floor(TIME[2] * 500) / 500, CHANNELS[1:])}, "4.10"),
        errors.RepeatedTime,
        "row 2, column time: the time 0 s is repeated",
        needs=MDF,
    ),
    broken(
        "run.mf4",
        "a speed recorded after the other channels",
        lambda p: mdf(
            p,
            {"a": (TIME[2], [VOLTAGE, CURRENT, TEMPERATURE]), "b": (TIME[2] + 1.0, [SPEED])},
            "4.10",
        ),
        errors.NoRows,
        "speed have no time in common with voltage",
        needs=MDF,
    ),
    broken(
        "run.mf4",
        "two speeds",
        lambda p: mdf(
            p,
            {
                "electrical": (TIME[2], [VOLTAGE, CURRENT]),
                "encoder": (TIME[2], [SPEED]),
                "resolver": (TIME[2], [SPEED]),
            },
            "4.10",
        ),
        errors.AmbiguousColumn,
        "'encoder/speed', 'resolver/speed' are all possible for speed_rad_s",
        needs=MDF,
    ),
)


BROKEN = (
    *BROKEN_DEVICES,
    *BROKEN_MATLAB,
    *BROKEN_OBJECTS,
    *BROKEN_HDF5,
    *BROKEN_WORKBOOKS,
    *BROKEN_COLUMNAR,
    *BROKEN_MEASUREMENTS,
)
