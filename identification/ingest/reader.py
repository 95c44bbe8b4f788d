"""Interface of the file readers: recognise a format, describe its columns, read their cells.

`read_run` asks each `Reader` in turn whether it recognises the file, maps the columns of the opened
`SourceTable` to channels, and reads the cells of these channels.  Units, checks and warnings are
common to all formats.  docs/write-a-reader.md shows a complete reader.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arrays import Array
from identification.errors import FileTooLarge, MissingValue, NotANumber, NotFinite, RunFileError
from identification.ingest.channels import Channel
from identification.ingest.columns import Column
from identification.ingest.display import quoted
from identification.ingest.faults import Faults
from identification.ingest.file import Limits, RunFile
from identification.ingest.run import RunWarning, SourceLocator
from identification.ingest.timing import check_time

__all__ = [
    "ArrayTable",
    "ColumnTable",
    "Reader",
    "Samples",
    "SourceTable",
    "TableSet",
    "blank_cell",
    "converted",
    "not_finite",
    "numbers",
    "refuse_large",
    "refuse_not_finite",
]


_EXACT_INTEGERS = 2**53


@dataclass(frozen=True)
class Samples:
    """Cells of the channels, as written in the file."""

    cells: dict[str, Array]
    """Channel name to (n_sample,), in the units of the file, NaN where a cell is blank."""
    row: Callable[[int], int]
    """Function from sample index to row in the file: its line, or the row of its sheet."""
    warnings: tuple[RunWarning, ...] = ()
    methods: Mapping[str, str] = field(default_factory=dict)
    """Channel name to ``linear`` or ``hold``, for channels brought to the clock of another one."""


class SourceTable(Protocol):
    """Table of an open file, whose header is known and whose cells are not yet read."""

    @property
    def columns(self) -> Sequence[Column]:
        """Columns from left to right, each with its position, names and units."""

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Read the cells of the columns assigned to channels; called once.

        Raises:
            RunFileError: A cell is not a number, with its row and column.
        """


@dataclass(frozen=True)
class TableSet:
    """Tables of a file that can hold several."""

    kind: str
    """Word for a table in messages, such as ``sheet``."""
    tables: Mapping[str, SourceTable]
    """Tables by name, in the order of the file."""
    joined: SourceTable | None = None
    """The channels of all tables as one, if their clocks have a common origin."""
    notes: str = ""
    """Content that is not read, for the error of a file without a run."""


class Reader(Protocol):
    """Reader of one file format; it keeps no state between files."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True if the name and the first bytes, at most 64 KiB, are those of the format."""

    def open(self, file: RunFile) -> SourceTable | TableSet:
        """Read as much of the file as describes its columns.

        Raises:
            RunFileError: The file has no table; `read_run` adds the file name to the error.
        """


@dataclass(frozen=True)
class ArrayTable:
    """Source table in memory."""

    columns: Sequence[Column]
    cells: Sequence[ArrayLike]
    """(n_sample,) for each column, NaN where the file has no value."""
    first_row: int = 1
    """Row of the first sample in messages."""

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Select the arrays of the channels."""
        cells = {
            channel.name: np.asarray(self.cells[channel.column.index], dtype=np.float64)
            for channel in channels
        }
        return Samples(cells, lambda sample: self.first_row + sample)


@dataclass(frozen=True)
class ColumnTable:
    """Table whose columns are loaded one by one."""

    columns: Sequence[Column]
    load: Callable[[Column], ArrayLike]
    """Function from a column to its cells, (n_sample,) of any numeric type."""
    warnings: tuple[RunWarning, ...] = ()

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Load the columns of the channels; samples are counted from 1 in messages."""
        cells = converted(channels, lambda channel: self.load(channel.column))
        return Samples(cells, lambda sample: sample + 1, self.warnings)


def blank_cell(channel: Channel, row: int) -> MissingValue:
    """Error for a blank cell of a channel that must not have any."""
    return MissingValue(
        f"the cell is blank; expected a number in {channel.unit.name} (a channel with times of "
        "its own is blank in at least a third of the rows); fill the cell, cut the run there, or "
        "export all channels at the same times",
        row=row,
        column=channel.column.label,
    )


def not_finite(cell: str, channel: Channel, row: int) -> NotFinite:
    """Error for a cell that is infinite or a word for a missing number."""
    return NotFinite(
        f"{quoted(cell)} is not a finite number; expected a number in {channel.unit.name}; "
        "cut the run before or after the invalid samples, or leave the cell blank where the "
        "channel was not logged",
        row=row,
        column=channel.column.label,
        value=cell,
    )


def refuse_not_finite(
    channels: Iterable[Channel],
    cells: Mapping[str, Array],
    row: Callable[[int], int],
    faults: Faults | None = None,
) -> None:
    """Reject infinities, and blanks of channels that must not have any, all at once.

    Arguments as in `Samples`; `faults` were found before and are reported with these.
    """
    faults = faults or Faults()
    used = {channel.name: channel for channel in channels}
    for name, channel in used.items():
        values = cells[name]
        blank = np.isnan(values)
        faulty = np.isinf(values) if channel.may_be_blank else np.isinf(values) | blank
        for sample in np.flatnonzero(faulty).tolist():
            at = row(sample)
            infinite = not_finite(str(values[sample]), channel, at)
            faults.add(blank_cell(channel, at) if blank[sample] else infinite)
    time = used.get("time_s")
    if time is not None and faults.errors():
        # The times are checked later if the cells are sound.
        seconds = cells["time_s"] * (time.scale * time.unit.factor)
        try:
            check_time(seconds, SourceLocator("", {"time_s": time.column.label}, row))
        except RunFileError as error:
            error.file = None
            faults.add(error)
    faults.refuse()


def converted(
    channels: Sequence[Channel], load: Callable[[Channel], ArrayLike]
) -> dict[str, Array]:
    """Cells (n_sample,) of each channel by its name; dates count from the first of all times."""
    cells: dict[str, Array] = {}
    first: NDArray[np.generic] | None = None
    for channel in channels:
        raw = np.asarray(load(channel))
        first = raw if first is None and channel.unit.quantity == "time" else first
        cells[channel.name] = numbers(raw, channel.column, first)
    return cells


def refuse_large(limits: Limits, rows: int, columns: int = 0) -> None:
    """Reject declared sizes above the limits, before anything is read.

    Raises:
        FileTooLarge: There are more rows or columns than the limit.
    """
    for what, count, most in (("rows", rows, limits.rows), ("columns", columns, limits.columns)):
        if count > most:
            raise FileTooLarge(
                f"{count} {what} are more than the limit of {most}; export only the time and the "
                "channels of the run",
                value=count,
            )


def numbers(values: ArrayLike, column: Column, times: NDArray[np.generic] | None = None) -> Array:
    """Convert cells (n_sample,) of a column to floating point.

    Dates become seconds from the first date.  Integers too large for a floating point number, such
    as nanoseconds since 1970, become differences from the first one, or from that of `times`.

    Raises:
        NotANumber: The cells are texts, complex numbers or objects.
    """
    cells = np.asarray(values)
    first = cells if times is None else times
    if cells.dtype.kind in "mM":
        return _seconds(cells, first if first.dtype.kind == cells.dtype.kind else cells)
    if "time" in column.quantities and first.dtype.kind in "iu" and first.size:
        largest = max(abs(int(first.min())), abs(int(first.max())))
        if largest > _EXACT_INTEGERS and cells.dtype.kind in "iuf":
            cells = cells - first[0]
    if cells.dtype.kind not in "biuf" or cells.ndim != 1:
        raise NotANumber(
            f"the cells have the type {cells.dtype} and the shape {cells.shape}; expected one "
            "number for each sample",
            column=column.label,
        )
    return np.ascontiguousarray(cells, dtype=np.float64)


def _seconds(cells: NDArray[np.generic], first: NDArray[np.generic]) -> Array:
    """Seconds from the first date of `first`, or of each duration; NaN where there is none."""
    blank = np.isnat(cells)
    # Differences are taken in whole nanoseconds, which a floating point number since 1970 loses.
    kind = "datetime64[ns]" if cells.dtype.kind == "M" else "timedelta64[ns]"
    ticks = cells.astype(kind).astype(np.int64)
    dates = first[~np.isnat(first)].astype(kind).astype(np.int64)
    if cells.dtype.kind == "M" and dates.size:
        ticks = ticks - dates[0]
    return np.where(blank, np.nan, ticks / 1e9)
