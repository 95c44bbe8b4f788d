"""Files with objects of MATLAB, written by mat-io; the properties of logs imitate Simulink."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from identification import errors
from tests.ingest.writers import (
    CHANNELS,
    RECORD,
    TIME,
    BrokenSpecimen,
    Specimen,
    broken,
    compressed,
)

__all__ = ["BROKEN_OBJECTS", "OBJECTS"]

MATIO = ("matio",)


def objects(version: str, variables: Callable[[], dict[str, object]]) -> Callable[[Path], None]:
    """Writer of variables with objects, in a version of MATLAB files."""

    def written(path: Path) -> None:
        import matio

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            matio.save_to_mat(path, variables(), version=version)

    return written


def opaque(kind: str, **properties: object) -> object:
    """Object of a class with its stored properties."""
    from matio.utils.matclass import MatlabOpaque

    return MatlabOpaque(properties, kind)


def timetable() -> dict[str, object]:
    """A timetable whose row times are durations."""
    columns = {name: values for name, values in RECORD.items() if name != "time_s"}
    index = pd.Index(pd.to_timedelta(np.round(TIME[2] * 1e6), unit="us"), name="Time")
    return {"tt": pd.DataFrame(columns, index=index), "note": "bench 3"}


def dated_timetable() -> dict[str, object]:
    """A timetable whose row times are dates, in a struct."""
    table = timetable()["tt"]
    assert isinstance(table, pd.DataFrame)
    table.index = (pd.to_timedelta(table.index) + pd.Timestamp("2026-03-01T08:00:00")).rename(
        "Time"
    )
    struct = np.empty((1, 1), dtype=[("tt", object)])
    struct[0, 0]["tt"] = table
    return {"bench": struct}


def table() -> dict[str, object]:
    """A table of numbers and texts."""
    return {"log": pd.DataFrame({**RECORD, "state": ["on"] * len(TIME[2])})}


def series(name: str, unit: object, values: object, **times: object) -> object:
    """A timeseries with the properties that MATLAB stores."""
    about = {"Units": "seconds", "Start_": np.array([[0.0]]), "Increment_": np.array([[np.nan]])}
    stored = {"Time_": TIME[2][:, None], **times}
    metadata = {k: stored.pop(k) for k in tuple(stored) if k in ("Units", "Length", "Increment_")}
    return opaque(
        "timeseries",
        Name=name,
        Data=np.empty((0, 0)),
        Data_=np.asarray(values)[:, None],
        TimeInfo=opaque("tsdata.timemetadata", **{**about, **metadata}),
        DataInfo=opaque("tsdata.datametadata", Units=unit),
        **stored,
    )


def stored_outside(path: Path) -> None:
    """A timetable of version 7.3 whose hidden data are in another file."""
    objects("v7.3", timetable)(path)
    with h5py.File(path, "r+") as file:
        file.create_dataset("#refs#/more", (40,), "f8", external=[("/etc/passwd", 0, 320)])


def declared_large(path: Path) -> None:
    """A timetable of version 7.3 that declares two billion numbers in its hidden data."""
    objects("v7.3", timetable)(path)
    with h5py.File(path, "r+") as file:
        file.create_dataset("#refs#/more", (2_000_000_000,), "f8", chunks=(1_000_000,))


IMPLIED = {
    "Time_": np.empty((0, 0)),
    "Increment_": np.array([[1e-3]]),
    "Length": np.array([[float(len(TIME[2]))]]),
}
"""Times that are stored as start, increment and number."""


def workspace(**times: object) -> dict[str, object]:
    """A timeseries for each channel."""
    return {name: series(name, unit, v, **times) for name, unit, v in CHANNELS[1:]}


def dataset() -> dict[str, object]:
    """A log of Simulink: signals with a name, whose values are a timeseries of another name."""
    elements = np.empty((1, 4), dtype=object)
    for place, (name, unit, values) in enumerate(CHANNELS[1:]):
        shown = opaque("Simulink.SimulationData.Unit", Name=unit)
        elements[0, place] = opaque(
            "Simulink.SimulationData.Signal",
            Name=name,
            Values=series("unnamed", shown, values, **IMPLIED),
        )
    storage = opaque("Simulink.SimulationData.Storage.RamDatasetStorage", Elements=elements)
    logged = opaque("Simulink.SimulationData.Dataset", Name="logsout", Storage_=storage)
    return {"logsout": logged}


OBJECTS = tuple(
    Specimen(
        f"{name}{version[1:].replace('.', '')}.mat",
        title,
        objects(version, make),
        MATIO,
        None,
        implied,
    )
    for version in ("v7", "v7.3")
    for name, title, make, implied in (
        ("timetable", "a timetable", timetable, False),
        ("dated", "a timetable with dates in a struct", dated_timetable, False),
        ("table", "a table", table, False),
        ("timeseries", "a timeseries for each channel", workspace, False),
        ("uniform", "timeseries with an increment", lambda: workspace(**IMPLIED), True),
        ("dataset", "a Dataset of Simulink", dataset, True),
    )
)

BROKEN_OBJECTS: tuple[BrokenSpecimen, ...] = (
    broken(
        "run.mat.gz",
        "a timetable in a compressed file",
        compressed(objects("v7", timetable)),
        errors.NoTable,
        "tt (timetable) cannot be read",
        "not read from compressed files: unpack it",
        needs=MATIO,
    ),
    broken(
        "run.mat",
        "a timeseries in a unit of time that is not known",
        objects("v7", lambda: workspace(Units="fortnights")),
        errors.NoTable,
        "current (timeseries)",
        "log.NAME = struct('Time', voltage.Time, 'Data', voltage.Data); save('run.mat', 'log')",
        needs=MATIO,
    ),
    broken(
        "run.mat",
        "timeseries whose length is not that of their samples",
        objects("v7.3", lambda: workspace(**IMPLIED | {"Length": np.array([[39.0]])})),
        errors.NoTable,
        "speed (timeseries)",
        needs=MATIO,
    ),
    broken(
        "run.mat",
        "a timetable whose data are in another file",
        stored_outside,
        errors.UnsupportedContent,
        "'/#refs#/more' is data in another file",
        needs=MATIO,
    ),
    broken(
        "run.mat",
        "a timetable that declares 16 GB",
        declared_large,
        errors.FileTooLarge,
        "the objects have more bytes than the limit of",
        needs=MATIO,
    ),
    broken(
        "run.mat",
        "an object of a class of one's own",
        objects("v7", lambda: {"bench": opaque("BenchLog", gain=np.array([[3.0]]))}),
        errors.NoTable,
        "bench (BenchLog) cannot be read outside MATLAB",
        "log = struct('time_s', t, 'speed_rad_s', w) with the vectors of bench",
        needs=MATIO,
    ),
)
