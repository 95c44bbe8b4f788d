"""Writers of run files in every format: the formats' own libraries, and named imitations."""

from __future__ import annotations

import gzip
import struct
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from numpy.typing import NDArray

from identification import errors
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


@dataclass(frozen=True)
class BrokenSpecimen:
    """A broken file, its error, and texts that the message contains."""

    file: Specimen
    error: type[errors.RunFileError]
    words: tuple[str, ...] = field(default=())


def broken(
    name: str,
    title: str,
    write: Callable[[Path], object],
    error: type[errors.RunFileError],
    *words: str,
    needs: tuple[str, ...] = (),
    mapping: Mapping[str, object] | None = None,
) -> BrokenSpecimen:
    """Describe a broken file."""
    return BrokenSpecimen(Specimen(name, title, write, needs, mapping), error, words)


def cut(write: Callable[[Path], object], share: float) -> Callable[[Path], None]:
    """Writer of the first part of a file."""

    def written(path: Path) -> None:
        write(path)
        content = path.read_bytes()
        path.write_bytes(content[: int(len(content) * share)])

    return written


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


def zipped(path: Path, members: Mapping[str, Mapping[str, Sequence[float] | Array]]) -> None:
    """Write an archive of text tables."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, columns in members.items():
            archive.writestr(name, write(columns))


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


def mat(path: Path, variables: Mapping[str, object]) -> None:
    """Write a MATLAB file of version 5 with scipy, compressed as MATLAB does."""
    scipy.io.savemat(path, dict(variables), do_compression=True)


def mat4(path: Path, variables: Mapping[str, Array], *, is_big_endian: bool = False) -> None:
    """Write column vectors as MATLAB does with -v4 (MATLAB MAT-File Format, 1-36)."""
    order = ">" if is_big_endian else "<"
    content = b""
    for name, values in variables.items():
        head = struct.pack(f"{order}5i", 1000 * is_big_endian, len(values), 1, 0, len(name) + 1)
        content += head + name.encode() + b"\0" + values.astype(f"{order}f8").tobytes()
    path.write_bytes(content)


def hdf5(path: Path, write_into: Callable[[h5py.File], object], userblock: int = 0) -> None:
    """Write an HDF5 file with h5py."""
    with h5py.File(path, "w", userblock_size=userblock) as file:
        write_into(file)


def datasets(group: h5py.Group, channels: Sequence[Channel] = ()) -> h5py.Group:
    """Write channels with their units as attributes, or the canonical columns."""
    for name, unit, values in channels:
        group.create_dataset(name, data=values, compression="gzip").attrs["units"] = unit
    for name, values in {} if channels else RECORD.items():
        group[name] = values
    return group


def compound(group: h5py.Group) -> None:
    """Write one dataset whose fields are the columns."""
    table = np.zeros(len(TIME[2]), dtype=[(name, "f8") for name in RECORD])
    for name, values in RECORD.items():
        table[name] = values
    group["log"] = table


def matrix(group: h5py.Group) -> None:
    """Write one matrix with the names of its columns as an attribute."""
    group["log"] = np.column_stack(list(RECORD.values()))
    group["log"].attrs["columns"] = list(RECORD)


def mat73(path: Path, write_into: Callable[[h5py.File], object]) -> None:
    """Imitate a file of MATLAB 7.3: HDF5 behind the text of a MATLAB file."""
    hdf5(path, write_into, userblock=512)
    content = bytearray(path.read_bytes())
    content[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(content)


def matlab_variable(group: h5py.Group, name: str, value: Array | str) -> h5py.Dataset:
    """Imitate a variable of MATLAB 7.3: text as codes, a vector as one row of a matrix."""
    if isinstance(value, str):
        codes = np.array([[ord(character)] for character in value], dtype=np.uint16)
        dataset = group.create_dataset(name, data=codes)
    else:
        dataset = group.create_dataset(name, data=value[None, :])
    dataset.attrs["MATLAB_class"] = np.bytes_("char" if isinstance(value, str) else "double")
    return dataset


def matlab_struct(file: h5py.File) -> None:
    """Imitate a struct of MATLAB 7.3, with a struct of the units."""
    log, units = file.create_group("log"), file.create_group("log/units")
    for group in (log, units):
        group.attrs["MATLAB_class"] = np.bytes_("struct")
    for name, unit, values in CHANNELS:
        matlab_variable(log, name, values)
        matlab_variable(units, name, unit)


def matlab_simulink(file: h5py.File) -> None:
    """Imitate a log of Simulink in MATLAB 7.3: an array of structs is a list for each field."""
    matlab_variable(file, "out/time", TIME[2])
    kept = file.create_group("#refs#")
    for key in ("values", "label"):
        references = []
        for number, (name, unit, values) in enumerate(CHANNELS[1:]):
            value = values if key == "values" else f"{name} [{unit}]"
            references.append(matlab_variable(kept, f"{key}{number}", value).ref)
        file[f"out/signals/{key}"] = np.array(references, dtype=h5py.ref_dtype)


def simulink() -> dict[str, object]:
    """Log of Simulink in the format "structure with time"."""
    signals = [
        {"values": values[:, None], "dimensions": 1.0, "label": f"{name} [{unit}]"}
        for name, unit, values in CHANNELS[1:]
    ]
    return {"logsout": {"time": TIME[2], "signals": signals, "blockName": "bench/Scope"}}


def timeseries() -> dict[str, object]:
    """Exported timeseries of a Simulink log, one struct for each signal."""
    return {
        "logs": {
            name: {"Name": name, "Time": TIME[2], "Data": values, "DataInfo": {"Units": unit}}
            for name, unit, values in CHANNELS[1:]
        }
    }


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
