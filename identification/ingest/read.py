"""Run file reader: convert one file or DataFrame into a checked `Run`, or list its columns.

    file -> table -> channels -> cells -> SI units -> checks
            reader   channels    reader   here        timing, clipping, plausibility

The reader of the format is the first that recognises the file; all other steps are common to all
formats.  Each step raises an error or returns data that later steps need not check again.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from identification.arrays import Array
from identification.errors import AbsurdValue, FileTooLarge, MissingColumn, RaggedRow, TooFewRows
from identification.ingest.channels import Channel
from identification.ingest.clipping import find_clipped
from identification.ingest.clocks import apart
from identification.ingest.columns import Column, may_be_duty, similar_columns
from identification.ingest.derived import CHOPPER_REMARK, unwrapped, with_speed, with_voltage
from identification.ingest.display import listed, plain
from identification.ingest.file import Limits, RunFile, naming, open_run_file, unpacked
from identification.ingest.formats import FORMAT_READERS
from identification.ingest.frame import Frame
from identification.ingest.held import find_held
from identification.ingest.mapping import MappingLike, RunMapping, read_mapping
from identification.ingest.names import is_direction
from identification.ingest.plausibility import check_values
from identification.ingest.reader import Reader, Samples, SourceTable, TableSet, refuse_not_finite
from identification.ingest.rounded import without_rounding
from identification.ingest.run import Run, RunWarning, Source, SourceLocator
from identification.ingest.side_by_side import with_own_clocks
from identification.ingest.supplied import requested, supplied
from identification.ingest.tables import choose_table, closest_table
from identification.ingest.text import TextReader
from identification.ingest.timing import check_time, find_segments

__all__ = ["FEWEST_ROWS", "READERS", "list_columns", "opened", "read_run"]

FEWEST_ROWS = 10
"""Smallest accepted number of samples; fewer carry too little information for seven parameters."""

READERS: tuple[Reader, ...] = (*FORMAT_READERS, TextReader())
"""Readers of all formats in the order in which they are asked; the last one accepts any file."""


def read_run(
    source: str | os.PathLike[str] | pd.DataFrame,
    *,
    name: str | None = None,
    mapping: MappingLike | None = None,
    limits: Limits | None = None,
    readers: Sequence[Reader] = (),
) -> Run:
    """Read and check one run.

    Args:
        source: File in a format of docs/run-files.md, or of one of `readers`; or a DataFrame with a
            row for each sample, whose columns are named like those of a file.
        name: Name of the run in messages and in the result; default: the file name.
        mapping: Columns of the channels, ``{"speed_rad_s": {"column": "n", "unit": "rpm"}}``, or
            the path of a JSON file with such a mapping; default: taken from the header.
        limits: Size limits of the file.
        readers: Readers of further formats, which are asked before those of `READERS`.

    Returns:
        The run in SI units, with its segments, clipped samples and warnings.

    Raises:
        RunFileError: The file cannot be read as a run; the class and its `code` give the reason.
    """
    limits = limits or Limits()
    if isinstance(source, pd.DataFrame):
        shown = plain(name if name is not None else "DataFrame", 200)
        with naming(shown):
            frame = Frame(source, shown)
            table = with_own_clocks(frame, shown)
            return _run(frame, table, read_mapping(mapping, shown), limits)
    shown = _shown(source, name)
    with naming(shown):
        run_mapping = read_mapping(mapping, shown)
        with open_run_file(Path(source), shown, limits) as file:
            return _run(file, opened(file, (*readers, *READERS)), run_mapping, limits)


def list_columns(
    path: str | os.PathLike[str], *, name: str | None = None, limits: Limits | None = None
) -> tuple[Column, ...]:
    """Columns of a run file from left to right, among which a user selects the channels.

    Raises:
        RunFileError: The file contains no table.
    """
    shown = _shown(path, name)
    with naming(shown), open_run_file(Path(path), shown, limits or Limits()) as file:
        return tuple(closest_table(opened(file, READERS)).columns)


def _shown(path: str | os.PathLike[str], name: str | None) -> str:
    return plain(name if name is not None else os.path.basename(os.fspath(path)), 200)


def opened(file: RunFile, readers: Sequence[Reader]) -> SourceTable | TableSet:
    """Table or tables of a file, by the first reader that recognises it."""
    content = unpacked(file)
    reader = next(r for r in readers if r.recognises(content.name, content.head))
    return with_own_clocks(reader.open(content), content.name)


def _check_size(samples: Samples, limits: Limits) -> None:
    shapes = {cells.shape for cells in samples.cells.values()}
    rows = next(iter(samples.cells.values())).size
    if shapes != {(rows,)}:
        raise RaggedRow(
            f"the columns have the shapes {sorted(shapes)}; expected one cell for each sample; "
            "save a channel with times of its own as a struct or group with Time and Data"
        )
    if rows > limits.rows:
        raise FileTooLarge(
            f"{rows} samples are more than the limit of {limits.rows}; "
            "split the file or record at a lower rate",
            value=rows,
        )
    _refuse_few(rows, samples.row)


def _refuse_few(rows: int, row: Callable[[int], int]) -> None:
    if rows < FEWEST_ROWS:
        raise TooFewRows(
            f"{rows} samples are too few for an identification; expected at least {FEWEST_ROWS}",
            row=row(rows - 1) if rows else None,
            value=rows,
        )


def _run(
    file: RunFile | Frame, opened: SourceTable | TableSet, mapping: RunMapping, limits: Limits
) -> Run:
    """Choose a table, assign its columns, read its cells, convert to SI units and check."""
    table, channels = choose_table(opened, mapping)
    samples = table.read(requested(channels))
    _check_size(samples, limits)
    samples = apart(samples, requested(channels), file.name)
    _check_size(samples, limits)
    labels = {name: channel.column.label for name, channel in channels.items()}
    locator = SourceLocator(file.name, labels, samples.row)
    samples, supplies = supplied(samples, channels, locator)
    values, warnings = _values(channels, samples, locator)
    warnings += supplies
    sources = {name: _source(c, samples.methods.get(name)) for name, c in channels.items()}
    if "duty" in channels:
        values, locator, note = with_voltage(values, locator)
        warnings.append(note)
        product = f"{sources['duty'].header} x {sources['bus_voltage_V'].header}"
        sources["voltage_V"] = Source(product, "V", method="duty")
    if "speed_rad_s" not in channels:
        values, locator, note = with_speed(values, channels["position_rad"], locator)
        _refuse_few(values["time_s"].size, locator.row)
        warnings.append(note)
        sources["speed_rad_s"] = dataclasses.replace(sources["position_rad"], method="difference")
    time = values.pop("time_s")
    segments, notes = find_segments(time, locator)
    warnings += notes
    constants = [name for name, channel in channels.items() if channel.value is not None]
    warnings += check_values(values, time, locator, constants)
    measured = {name: values[name] for name in ("voltage_V", "current_A", "speed_rad_s")}
    clipped, notes = find_clipped(measured, locator)
    held, pulses, more = find_held(measured, time, locator)
    notes += more
    used = {column.index for channel in channels.values() for column in channel.columns}
    spare = [column for column in table.columns if column.index not in used and column.texts]
    run = Run(
        name=file.name,
        sha256=file.sha256(),
        time=time,
        voltage=values["voltage_V"],
        current=values["current_A"],
        speed=values["speed_rad_s"],
        temperature=values.get("temperature_degC"),
        position=values.get("position_rad"),
        segments=segments,
        clipped=clipped,
        held=held,
        pulses=pulses,
        sources=sources,
        direction=next((c.title for c in spare if any(map(is_direction, c.texts))), None),
    )
    about_file = (*_header_warnings(spare, channels, run, locator), *samples.warnings)
    return dataclasses.replace(run, warnings=(*about_file, *warnings, *notes))


def _values(
    channels: dict[str, Channel], samples: Samples, locator: SourceLocator
) -> tuple[dict[str, Array], list[RunWarning]]:
    """Channels in SI units, with an increasing time and an angle without jumps."""
    refuse_not_finite(channels.values(), samples.cells, locator.row)
    warnings: list[RunWarning] = []
    values: dict[str, Array] = {}
    clock = samples.cells["time_s"]
    is_derived = "speed_rad_s" not in channels
    if is_derived and "position_rad" in samples.methods:
        raise MissingColumn(
            "no column for speed_rad_s, and the angle has another clock than the voltage, so that "
            "its differences would be those of an interpolation; log the speed, or the angle at "
            "the times of the voltage",
            column=channels["position_rad"].column.label,
        )
    for name, channel in channels.items():
        cells, notes = _filled(channel, samples.cells.pop(name), clock, locator)
        warnings += notes
        if cells is None:
            continue
        if channel.period is not None or (name == "position_rad" and is_derived):
            cells = unwrapped(cells, values["time_s"], channel, locator)
        values[name] = _in_si(cells, channel, locator)
        if name == "time_s":
            check_time(values[name], locator)
            values[name], notes = without_rounding(values[name], locator)
            warnings += notes
    return values, warnings


def _filled(
    channel: Channel, cells: Array, clock: Array, locator: SourceLocator
) -> tuple[Array | None, list[RunWarning]]:
    """Fill the blanks of a channel logged at a lower rate by linear interpolation over time.

    A motor's temperature changes over minutes, so linear interpolation is closer to it than a
    sample-and-hold.  Before the first and after the last value the nearest value is held.
    """
    known = np.isfinite(cells)
    logged = np.count_nonzero(known)
    if logged in (0, cells.size):
        return cells if logged else None, []
    message = (
        f"{cells.size - logged} of {cells.size} cells are blank; the temperature is interpolated "
        f"linearly between the {logged} logged values"
    )
    first = int(np.argmin(known))
    note = locator.warning("interpolated_temperature", message, channel.name, first)
    return np.interp(clock, clock[known], cells[known]), [note]


def _in_si(cells: Array, channel: Channel, locator: SourceLocator) -> Array:
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
        raise locator.error(
            AbsurdValue,
            f"{cells[sample]:.6g} is too large after scaling; check the scale in the mapping",
            channel.name,
            sample,
            float(cells[sample]),
        )
    return values


def _source(channel: Channel, method: str | None) -> Source:
    if not channel.is_logged:
        method = "row" if channel.value is None else "constant"
    scaling = channel.scale, channel.offset, channel.period
    sign = channel.sign.title if channel.sign else None
    return Source(channel.column.title, channel.unit.name, *scaling, sign, channel.value, method)


def _header_warnings(
    spare: Sequence[Column], channels: dict[str, Channel], run: Run, locator: SourceLocator
) -> Iterator[RunWarning]:
    if run.temperature is None:
        similar = similar_columns("temperature_degC", spare)
        titles = listed(column.title for column in similar)
        found = f"it may be {titles}" if similar else "no similar column"
        blank = "temperature_degC" in channels
        why = "all temperatures are blank" if blank else f"no temperature column ({found})"
        yield locator.warning(
            "no_temperature",
            f"{why}; the run is used at one unknown temperature, and the temperature "
            "coefficients are not identifiable from it",
        )
    if spare:
        titles = listed(column.title for column in spare)
        yield locator.warning("unused_columns", f"columns not used: {titles}")
    voltage = channels.get("voltage_V")
    if voltage is not None and voltage.scale != 1.0 and may_be_duty(voltage.column):
        yield locator.warning(
            "voltage_from_duty",
            f"the voltage is {voltage.column.title} times {voltage.scale:.6g} V, as of a constant "
            f"supply: {CHOPPER_REMARK}",
            "voltage_V",
        )
    for name, channel in channels.items():
        header, unit = channel.column.unit, channel.unit
        if header is None:
            continue
        if name == "current_A" and header.quantity != unit.quantity:
            yield locator.warning(
                "unknown_gain",
                f"the header gives {header.name}, and the mapping alone gives {unit.name}: the "
                "gain of a current sensor is not identifiable, so an error of this gain scales "
                "Ra25, L, J, b and the torques",
                name,
            )
        elif header != unit and channel.scale == 1.0:
            yield locator.warning(
                "unit_overridden",
                f"the header gives {header.name} and the mapping {unit.name}; the mapping is used",
                name,
            )
