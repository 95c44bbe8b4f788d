"""Columns of a binary file: read on demand, and converted from any numeric type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arrays import Array
from identification.errors import FileTooLarge, NotANumber
from identification.ingest.channels import Channel
from identification.ingest.columns import Column
from identification.ingest.file import Limits
from identification.ingest.reader import Samples
from identification.ingest.run import RunWarning

__all__ = ["ColumnTable", "converted", "numbers", "refuse_large"]

_EXACT_INTEGERS = 2**53


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
