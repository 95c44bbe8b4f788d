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

__all__ = ["ColumnTable", "numbers", "refuse_large"]

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
        cells = {c.name: numbers(self.load(c.column), c.column) for c in channels}
        return Samples(cells, lambda sample: sample + 1, self.warnings)


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


def numbers(values: ArrayLike, column: Column) -> Array:
    """Convert cells (n_sample,) of a column to floating point.

    Dates become seconds from the first date.  Integers too large for a floating point number, such
    as nanoseconds since 1970, become differences from the first one.

    Raises:
        NotANumber: The cells are texts, complex numbers or objects.
    """
    cells = np.asarray(values)
    if cells.dtype.kind in "mM":
        return _seconds(cells)
    if cells.dtype.kind in "iu" and cells.size:
        low, high = int(cells.min()), int(cells.max())
        if max(abs(low), abs(high)) > _EXACT_INTEGERS and "time" in column.quantities:
            cells = cells - cells[0]
    if cells.dtype.kind not in "biuf" or cells.ndim != 1:
        raise NotANumber(
            f"the cells have the type {cells.dtype} and the shape {cells.shape}; expected one "
            "number for each sample",
            column=column.label,
        )
    return np.ascontiguousarray(cells, dtype=np.float64)


def _seconds(cells: NDArray[np.datetime64] | NDArray[np.timedelta64]) -> Array:
    """Seconds from the first date, or of each duration; NaN where there is none."""
    blank = np.isnat(cells)
    # Differences are taken in whole nanoseconds, which a floating point number since 1970 loses.
    kind = "datetime64[ns]" if cells.dtype.kind == "M" else "timedelta64[ns]"
    ticks = cells.astype(kind).astype(np.int64)
    if cells.dtype.kind == "M" and not np.all(blank):
        ticks = ticks - ticks[~blank][0]
    return np.where(blank, np.nan, ticks / 1e9)
