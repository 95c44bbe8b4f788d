"""Files of MATLAB and HDF5 that are refused, with the expected error of each."""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import numpy as np

from identification import errors
from tests.ingest.writers import (
    CURRENT,
    RECORD,
    SPEED,
    TIME,
    VOLTAGE,
    broken,
    cut,
    datasets,
    hdf5,
    mat,
    mat4,
    mat73,
)

__all__ = ["BROKEN_HDF5", "BROKEN_MATLAB"]


def opaque(path: Path) -> None:
    """Imitate a timetable in version 5: the element of an opaque object holds class and data."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    flags = element(6, struct.pack("<II", 17, 0))
    texts = b"".join(element(1, text) for text in (b"tt", b"MCOS", b"timetable"))
    inner = element(
        14,
        element(6, struct.pack("<II", 13, 0))
        + element(5, struct.pack("<ii", 1, 1))
        + element(1, b"")
        + element(6, struct.pack("<I", 1)),
    )
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    path.write_bytes(header + element(14, flags + texts + inner))


def opaque73(file: h5py.File) -> None:
    """Imitate a log of Simulink as an object in version 7.3."""
    logs = file.create_dataset("logsout", data=np.zeros((1, 6), dtype="uint32"))
    logs.attrs["MATLAB_class"] = np.bytes_("Simulink.SimulationData.Dataset")
    logs.attrs["MATLAB_object_decode"] = np.int32(3)


def linked(file: h5py.File) -> None:
    """Link a channel to another file."""
    datasets(file)
    del file["speed_rad_s"]
    file["speed_rad_s"] = h5py.ExternalLink("/etc/passwd", "/speed")


def stored_outside(file: h5py.File) -> None:
    """Keep a channel in another file."""
    datasets(file)
    del file["speed_rad_s"]
    file.create_dataset("speed_rad_s", (40,), "f8", external=[("/etc/passwd", 0, 320)])


def virtual(file: h5py.File) -> None:
    """Compose a channel of another file."""
    datasets(file)
    del file["speed_rad_s"]
    layout = h5py.VirtualLayout(shape=(40,), dtype="f8")
    layout[:] = h5py.VirtualSource("/elsewhere/other.h5", "speed", shape=(40,))
    file.create_virtual_dataset("speed_rad_s", layout)


def bomb(file: h5py.File) -> None:
    """Declare two hundred million cells, which take a few bytes."""
    datasets(file)
    del file["speed_rad_s"]
    file.create_dataset(
        "speed_rad_s", (200_000_000,), "f8", chunks=(1_000_000,), compression="gzip"
    )


BROKEN_MATLAB = (
    broken(
        "run.mat",
        "a timetable, imitated",
        opaque,
        errors.NoTable,
        "tt (timetable) cannot be read outside MATLAB",
        "log = table2struct(timetable2table(tt, 'ConvertRowTimes', false), 'ToScalar', true)",
        "log.time_s = seconds(tt.Properties.RowTimes - tt.Properties.RowTimes(1))",
        "save('run.mat', 'log')",
    ),
    broken(
        "run.mat",
        "an object of Simulink in 7.3, imitated",
        lambda p: mat73(p, opaque73),
        errors.NoTable,
        "logsout (Simulink.SimulationData.Dataset) cannot be read",
        "log.(matlab.lang.makeValidName(e.Name)) = struct('Time', e.Values.Time",
    ),
    broken(
        "run.mat",
        "half of a file",
        cut(lambda p: mat(p, {"log": RECORD}), 0.5),
        errors.DamagedFile,
        "looks like a MATLAB file",
    ),
    broken(
        "run.mat",
        "half of a file of version 4",
        cut(lambda p: mat4(p, RECORD), 0.5),
        errors.DamagedFile,
        "looks like a MATLAB file",
    ),
    broken(
        "run.mat",
        "the header alone",
        lambda p: p.write_bytes(b"MATLAB 5.0 MAT-file, 2026" + bytes(99)),
        errors.DamagedFile,
        "looks like a MATLAB file",
    ),
    broken(
        "run.mat",
        "two complete structs",
        lambda p: mat(p, {"cold": RECORD, "hot": RECORD}),
        errors.AmbiguousTable,
        "the variables 'cold', 'hot' all contain a run",
    ),
    broken(
        "run.mat",
        "variables of different lengths",
        lambda p: mat(p, {**RECORD, "speed_rad_s": RECORD["speed_rad_s"][:30]}),
        errors.RaggedRow,
        "expected one cell for each sample",
    ),
    broken(
        "run.mat",
        "names without units and a name that is not known",
        lambda p: mat(p, {"log": {"t": TIME[2], "voltage": VOLTAGE[2], "x": SPEED[2]}}),
        errors.RunFileError,
        "the column may be voltage_V, but has no unit",
        "no column for current_A, speed_rad_s",
    ),
    broken(
        "run.mat",
        "t and T without units, which are time and temperature",
        lambda p: mat(p, {"log": {"t": TIME[2], "T": VOLTAGE[2], "i": CURRENT[2]}}),
        errors.AmbiguousUnit,
        "column t: the column may be time_s, but has no unit",
        "column T: the column may be temperature_degC, but has no unit",
    ),
    broken(
        "run.mat",
        "a log of Simulink without current",
        lambda p: mat(
            p,
            {
                "out": {
                    "time": TIME[2],
                    "signals": [
                        {"values": VOLTAGE[2], "label": "voltage [V]"},
                        {"values": SPEED[2], "label": "n [rpm]"},
                    ],
                }
            },
        ),
        errors.MissingColumn,
        "no column for current_A",
        "'time', 'voltage [V]', 'n [rpm]'",
    ),
    broken(
        "run.mat",
        "complex numbers",
        lambda p: mat(p, {**RECORD, "current_A": CURRENT[2] * 1j}),
        errors.MissingColumn,
        "no column for current_A",
    ),
)

BROKEN_HDF5 = (
    broken(
        "run.h5",
        "a link to another file",
        lambda p: hdf5(p, linked),
        errors.UnsupportedContent,
        "a link to the file '/etc/passwd'",
        "copy the data into the file",
    ),
    broken(
        "run.h5",
        "data in another file",
        lambda p: hdf5(p, stored_outside),
        errors.UnsupportedContent,
        "data in another file",
    ),
    broken(
        "run.h5",
        "a virtual dataset",
        lambda p: hdf5(p, virtual),
        errors.UnsupportedContent,
        "a virtual dataset of other files",
    ),
    broken(
        "run.h5",
        "a declared size above the limit",
        lambda p: hdf5(p, bomb),
        errors.FileTooLarge,
        "200000000 rows are more than the limit of",
    ),
    broken(
        "run.h5",
        "half of a file",
        cut(lambda p: hdf5(p, datasets), 0.5),
        errors.DamagedFile,
        "looks like an HDF5 or MATLAB 7.3 file",
    ),
    broken(
        "run.h5",
        "an empty file",
        lambda p: hdf5(p, lambda f: None),
        errors.NoTable,
        "no group with columns of numbers",
    ),
    broken(
        "run.h5",
        "a NaN",
        lambda p: hdf5(p, lambda f: datasets(f)["current_A"].write_direct(np.full(40, np.nan))),
        errors.MissingValue,
        "row 1, column current_A",
    ),
)
