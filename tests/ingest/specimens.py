"""Run files of every format, made by the formats' own writers; all hold the record of `samples`."""

from __future__ import annotations

import bz2
import gzip
import lzma

import numpy as np
import scipy.io
import scipy.sparse

from tests.ingest.devices import CLOCKS, DEVICES
from tests.ingest.loggers import LOGGERS
from tests.ingest.matlab_logs import OBJECTS
from tests.ingest.programs import PROGRAMS
from tests.ingest.samples import write
from tests.ingest.scopes import SCOPES
from tests.ingest.writers import (
    CANONICAL_SHEET,
    CHANNELS,
    CURRENT,
    MDF,
    NAMED,
    NAMED_UNITS,
    NAMES,
    PARQUET,
    RECORD,
    SPEED,
    STEPS,
    TDMS,
    TEMPERATURE,
    TIME,
    UNITS,
    VOLTAGE,
    XLSX,
    Specimen,
    compound,
    compressed,
    datasets,
    hdf5,
    mat,
    mat4,
    mat73,
    matlab_simulink,
    matlab_struct,
    matrix,
    mdf,
    parquet,
    rows,
    simulink,
    tdms,
    timeseries,
    workbook,
    zipped,
)

__all__ = ["SPECIMENS"]

SPARSE = scipy.sparse.eye_array(3, format="csc")


def pico() -> dict[str, object]:
    """Variables that PicoScope saves for MATLAB: channels by letter, and the clock as numbers."""
    channels = {
        letter: RECORD[name][:, None] for name, letter in zip([*RECORD][1:], "ABCD", strict=True)
    }
    about = {"Tstart": 0.0, "Tinterval": 1e-3, "ExtraSamples": 0.0, "RequestedLength": 40.0}
    return {**about, "Length": 40.0, "Version": "6.14", **channels}


def dated() -> dict[str, object]:
    """The record with the times as dates in nanoseconds."""
    ticks = np.round(RECORD["time_s"] * 1e9).astype("timedelta64[ns]")
    time: dict[str, object] = {"time": np.datetime64("2026-03-01T08:00:00", "ns") + ticks}
    return time | {name: values for name, values in RECORD.items() if name != "time_s"}


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
    Specimen("dates.parquet", "dates", lambda p: parquet(p, dated(), {}), PARQUET),
)

COMPRESSED = (
    Specimen(
        "run.csv.gz", "compressed text", lambda p: p.write_bytes(gzip.compress(write(RECORD)))
    ),
    Specimen("run.csv.bz2", "bzip2", lambda p: p.write_bytes(bz2.compress(write(RECORD)))),
    Specimen("run.csv.xz", "xz", lambda p: p.write_bytes(lzma.compress(write(RECORD)))),
    Specimen("run.csv.zip", "a table in an archive", lambda p: zipped(p, {"run.csv": RECORD})),
    Specimen(
        "export.zip",
        "a run, a note and a table of the device, as phyphox writes them",
        lambda p: zipped(
            p,
            {
                "export/run.csv": RECORD,
                "export/meta/time.csv": {"event": [1.0, 2.0], "experiment time": [0.0, 0.04]},
                "__MACOSX/._run.csv": {},
            },
        ),
    ),
    Specimen(
        "chosen.zip",
        "two runs, one of them chosen",
        lambda p: zipped(
            p, {"cold.csv": {**RECORD, "voltage_V": RECORD["time_s"]}, "hot.csv": RECORD}
        ),
        mapping={"table": "hot.csv"},
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

MATLAB = (
    Specimen("struct.mat", "a struct", lambda p: mat(p, {"log": RECORD, "gain": 3.0})),
    Specimen("workspace.mat", "variables", lambda p: mat(p, {**RECORD, "note": "bench 3"})),
    Specimen(
        "units.mat",
        "a struct with units",
        lambda p: mat(p, {"log": {**NAMED, "units": dict(zip(NAMES, UNITS, strict=True))}}),
    ),
    Specimen("nested.mat", "structs", lambda p: mat(p, {"bench": {"x": 1.0, "run": RECORD}})),
    Specimen(
        "columns.mat", "columns", lambda p: mat(p, {k: v[:, None] for k, v in RECORD.items()})
    ),
    Specimen(
        "integers.mat",
        "times in integers",
        lambda p: mat(
            p,
            {**RECORD, "time_s": [], "time_us": np.round(RECORD["time_s"] * 1e6).astype("uint32")},
        ),
        mapping={"time_s": {"column": "time_us", "unit": "us"}},
        is_clock_implied=True,
    ),
    Specimen(
        "chosen.mat",
        "two runs, one of them chosen",
        lambda p: mat(p, {"cold": {**RECORD, "voltage_V": RECORD["time_s"]}, "hot": RECORD}),
        mapping={"table": "hot"},
    ),
    Specimen(
        "sparse.mat",
        "variables, a sparse matrix among them and in a cell",
        lambda p: mat(p, {**RECORD, "map": SPARSE, "cells": np.array([SPARSE, 1], dtype=object)}),
    ),
    Specimen(
        "scipy4.mat",
        "version 4, a text and a matrix among the variables",
        lambda p: scipy.io.savemat(p, {"note": "bench 3", "map": np.eye(3), **RECORD}, format="4"),
    ),
    Specimen(
        "pico.mat",
        "start and interval of a PicoScope, imitated",
        lambda p: mat(p, pico()),
        mapping={
            name: {"column": letter, "unit": unit}
            for name, letter, unit in zip([*RECORD][1:], "ABCD", UNITS[1:], strict=True)
        },
        is_clock_implied=True,
    ),
    Specimen("little4.mat", "version 4", lambda p: mat4(p, RECORD)),
    Specimen("big4.mat", "version 4, big-endian", lambda p: mat4(p, RECORD, is_big_endian=True)),
    Specimen("simulink.mat", "a log of Simulink", lambda p: mat(p, simulink())),
    Specimen("timeseries.mat", "exported timeseries", lambda p: mat(p, timeseries())),
    Specimen("run.mat.gz", "compressed", compressed(lambda p: mat(p, {"log": RECORD}))),
    Specimen("imitation73.mat", "version 7.3, imitated", lambda p: mat73(p, matlab_struct)),
    Specimen("simulink73.mat", "Simulink in 7.3, imitated", lambda p: mat73(p, matlab_simulink)),
)

HDF5 = (
    Specimen("run.h5", "datasets", lambda p: hdf5(p, datasets)),
    Specimen("units.h5", "units", lambda p: hdf5(p, lambda f: datasets(f, CHANNELS))),
    Specimen(
        "groups.h5",
        "the run in a group beside another one",
        lambda p: hdf5(
            p,
            lambda f: (
                datasets(f.create_group("bench/run 1"), CHANNELS),
                datasets(f.create_group("calibration"), CHANNELS[:2]),
            ),
        ),
    ),
    Specimen("compound.h5", "a compound dataset", lambda p: hdf5(p, compound)),
    Specimen("matrix.h5", "a matrix with names", lambda p: hdf5(p, matrix)),
)

SPECIMENS = (
    *(*DEVICES, *SCOPES, *LOGGERS, *PROGRAMS, *CLOCKS, *MATLAB, *OBJECTS, *HDF5),
    *(*WORKBOOKS, *COLUMNAR, *COMPRESSED, *MEASUREMENTS),
)
