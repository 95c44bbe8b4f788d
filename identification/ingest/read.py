"""Run file reader: convert one file into a checked `Run`.

    bytes -> lines -> layout -> columns -> channels -> numbers -> SI units -> checks
             source   dialect   columns    channels    table      here        timing, clipping,
                                                                              plausibility

Each step either raises an error with file, row and column or returns data that later steps need not
check again.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import AbsurdValue, NoRows, RunFileError, TooFewRows
from identification.ingest.channels import Channel, assign_channels, similar_columns
from identification.ingest.clipping import find_clipped
from identification.ingest.columns import Column, read_columns
from identification.ingest.dialect import Layout, sniff
from identification.ingest.display import listed, plain
from identification.ingest.mapping import MappingLike, read_mapping
from identification.ingest.place import Places
from identification.ingest.plausibility import check_values
from identification.ingest.run import Run, RunWarning, Source
from identification.ingest.source import Limits, read_blocks
from identification.ingest.table import Table, TableReader
from identification.ingest.timing import check_time, find_segments

__all__ = ["FEWEST_ROWS", "read_run"]

Array = NDArray[np.float64]

FEWEST_ROWS = 10
"""Smallest accepted number of samples; fewer carry too little information for seven parameters."""

_SLOW_CHANNELS = ("temperature_degC",)


def read_run(
    path: str | os.PathLike[str],
    *,
    name: str | None = None,
    mapping: MappingLike | None = None,
    limits: Limits | None = None,
) -> Run:
    """Read and check one run file.

    Args:
        path: Text table in a format of docs/run-files.md.
        name: Name of the run in messages and in the result; default: the file name.
        mapping: Columns of the channels, ``{"speed_rad_s": {"column": "n", "unit": "rpm"}}``, or
            the path of a JSON file with such a mapping; default: taken from the header.
        limits: Size limits of the file.

    Returns:
        The run in SI units, with its segments, clipped samples and warnings.

    Raises:
        RunFileError: The file cannot be read as a run; the class and its `code` give the reason.
    """
    file = plain(name if name is not None else os.path.basename(os.fspath(path)), 200)
    try:
        return _read(Path(path), file, mapping, limits or Limits())
    except RunFileError as error:
        if error.file is not None:
            raise
        # The error comes from the mapping, or from a check that does not know the file name.
        raise type(error)(
            error.message, file=file, row=error.row, column=error.column, value=error.value
        ) from error


def _read(path: Path, file: str, mapping: MappingLike | None, limits: Limits) -> Run:
    said = read_mapping(mapping, file)
    digest = hashlib.sha256()
    blocks = read_blocks(path, file, limits, digest)
    block = next(blocks)
    layout = sniff(block, file, limits)
    columns = read_columns(layout.header)
    channels = assign_channels(columns, said, file)
    reader = TableReader(layout, channels, _SLOW_CHANNELS, file)
    reader.add(block.from_line(layout.first_line))
    for block in blocks:
        reader.add(block)
    table = reader.table()
    _refuse_short(table, layout, file)
    places = Places(file, {n: c.column.label for n, c in channels.items()}, table.lines.line)
    run = _checked(table, channels, places, digest.hexdigest())
    notes = _header_warnings(columns, channels, run, places) + _end_warnings(table, places)
    sources = {
        name: Source(channel.column.title, channel.unit.name, channel.scale, channel.offset)
        for name, channel in channels.items()
    }
    return dataclasses.replace(run, warnings=(*notes, *run.warnings), sources=sources)


def _refuse_short(table: Table, layout: Layout, file: str) -> None:
    rows = table.lines.total
    if rows == 0:
        raise NoRows(
            "no sample below the header; expected one line for each sample",
            file=file,
            row=layout.header_line,
        )
    if rows < FEWEST_ROWS:
        raise TooFewRows(
            f"{rows} samples are too few for an identification; expected at least {FEWEST_ROWS}",
            file=file,
            row=table.lines.line(rows - 1),
            value=rows,
        )


def _checked(table: Table, channels: dict[str, Channel], places: Places, sha256: str) -> Run:
    """Convert to SI units and check; the run lacks only the warnings about header and file end."""
    warnings: list[RunWarning] = []
    values: dict[str, Array] = {}
    clock = table.cells["time_s"]
    for name, channel in channels.items():
        cells = table.cells.pop(name)
        filled, notes = _filled(name, cells, clock, places)
        warnings += notes
        if filled is not None:
            values[name] = _in_si(filled, channel, places)
    time = values.pop("time_s")
    check_time(time, places)
    segments, notes = find_segments(time, places)
    warnings += notes
    warnings += check_values(values, time, places)
    measured = {name: values[name] for name in ("voltage_V", "current_A", "speed_rad_s")}
    clipped, notes = find_clipped(measured, places)
    return Run(
        name=places.file,
        sha256=sha256,
        time=time,
        voltage=values["voltage_V"],
        current=values["current_A"],
        speed=values["speed_rad_s"],
        temperature=values.get("temperature_degC"),
        position=values.get("position_rad"),
        segments=segments,
        clipped=clipped,
        warnings=(*warnings, *notes),
    )


def _filled(
    name: str, cells: Array, clock: Array, places: Places
) -> tuple[Array | None, list[RunWarning]]:
    """Fill the blanks of a channel logged at a lower rate by linear interpolation over time.

    A motor's temperature changes over minutes, so linear interpolation is closer to it than a
    sample-and-hold.  Before the first and after the last value the nearest value is held.
    """
    blank = np.isnan(cells)
    if not np.any(blank):
        return cells, []
    known = np.flatnonzero(~blank)
    if not known.size:
        return None, []
    return np.interp(clock, clock[known], cells[known]), [
        places.warning(
            "interpolated_temperature",
            f"{int(blank.sum())} of {cells.size} cells are blank; the temperature is interpolated "
            f"linearly between the {known.size} logged values",
            name,
            int(np.argmax(blank)),
        )
    ]


def _in_si(cells: Array, channel: Channel, places: Places) -> Array:
    """Value in SI units, ``(cell * scale + offset + shift) * factor``.

    Identity operations are skipped, which keeps canonical files exact to the last bit.
    """
    values = np.ascontiguousarray(cells, dtype=np.float64)
    with np.errstate(over="ignore"):
        if channel.scale != 1.0:
            values = values * channel.scale
        shift = channel.offset + channel.unit.shift
        if shift != 0.0:
            values = values + shift
        if channel.unit.factor != 1.0:
            values = values * channel.unit.factor
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        sample = int(wrong[0])
        raise places.error(
            AbsurdValue,
            f"{cells[sample]:.6g} is too large after scaling; check the scale in the mapping",
            channel.name,
            sample,
            float(cells[sample]),
        )
    return values


def _header_warnings(
    columns: list[Column], channels: dict[str, Channel], run: Run, places: Places
) -> list[RunWarning]:
    used = {channel.column.index for channel in channels.values()}
    spare = [column for column in columns if column.index not in used and column.texts]
    warnings = []
    if run.temperature is None:
        similar = similar_columns("temperature_degC", spare)
        found = listed(column.title for column in similar) if similar else "no similar column"
        blank = "temperature_degC" in channels
        why = "all temperatures are blank" if blank else f"no temperature column ({found})"
        warnings.append(
            places.warning(
                "no_temperature",
                f"{why}; the run is used at one unknown temperature, and the temperature "
                "coefficients are not identifiable from it",
            )
        )
    if spare:
        titles = listed(column.title for column in spare)
        warnings.append(places.warning("unused_columns", f"columns not used: {titles}"))
    return warnings + _override_warnings(channels, places) + _gain_warnings(channels, places)


def _override_warnings(channels: dict[str, Channel], places: Places) -> list[RunWarning]:
    """Warn if a mapping gives another unit than the header."""
    return [
        places.warning(
            "unit_overridden",
            f"the header gives {header.name} and the mapping {channel.unit.name}; "
            "the mapping is used",
            name,
        )
        for name, channel in channels.items()
        if (header := channel.column.unit) is not None
        and header != channel.unit
        and channel.scale == 1.0
    ]


def _gain_warnings(channels: dict[str, Channel], places: Places) -> list[RunWarning]:
    """Warn that the gain of a current sensor comes from the mapping alone."""
    header, unit = channels["current_A"].column.unit, channels["current_A"].unit
    if header is None or header.quantity == unit.quantity:
        return []
    return [
        places.warning(
            "unknown_gain",
            f"the header gives {header.name}, and the mapping alone gives {unit.name}: the gain of "
            "a current sensor is not identifiable, so an error of this gain scales Ra25, L, J, b "
            "and the torques",
            "current_A",
        )
    ]


def _end_warnings(table: Table, places: Places) -> list[RunWarning]:
    if table.cut_line is None:
        return []
    return [
        RunWarning(
            code="truncated_last_row",
            message="the last line is truncated, probably by a loss of power; it is omitted",
            file=places.file,
            row=table.cut_line,
        )
    ]
