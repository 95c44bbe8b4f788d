"""Run from a pandas DataFrame: columns by name and unit as in a file, times in seconds.

The names of the columns are read like the header of a file, so a name may contain a unit, and a
second level of the columns may hold the units.  A named index is a column, too.  Dates and
durations become seconds since the first sample.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.errors import DuplicateColumn, NotANumber
from identification.ingest.channels import Channel
from identification.ingest.columns import Column, describe_column, read_columns
from identification.ingest.display import quoted
from identification.ingest.reader import Samples, converted
from identification.ingest.supplied import direction_of

__all__ = ["Frame"]


class Frame:
    """DataFrame with a row for each sample as the source of a run; `name` is that in messages.

    Attributes:
        columns: Columns from left to right, a named index first.

    Raises:
        DuplicateColumn: The index and a column have the same name.
    """

    def __init__(self, data: pd.DataFrame, name: str) -> None:
        self.name = name
        self._data = _with_index(data)
        self.columns = _described(self._data)
        self._digest = hashlib.sha256()

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Convert the columns of the channels to numbers; a missing value becomes NaN.

        Raises:
            NotANumber: A cell is neither a number nor missing; its row is its position from 0.
        """
        cells = converted(channels, lambda c: _cells(self._data.iloc[:, c.column.index], c))
        for channel in channels:
            self._digest.update(f"{channel.column.title}\0".encode())
            self._digest.update(cells[channel.name].tobytes())
        return Samples(cells, lambda sample: sample)

    def load(self, column: Column) -> NDArray[np.generic]:
        """Cells of a column of any type, as of names of signals."""
        values = self._data.iloc[:, column.index]
        self._digest.update(f"{column.title}\0".encode())
        self._digest.update(pd.util.hash_pandas_object(values, index=False).to_numpy().tobytes())
        return values.to_numpy(f"{kind}8[ns]" if (kind := values.dtype.kind) in "mM" else None)

    def sha256(self) -> str:
        """SHA-256 of the names and the values that were read, in hexadecimal."""
        return self._digest.hexdigest()


def _with_index(data: pd.DataFrame) -> pd.DataFrame:
    """The frame with its named index as columns; an unnamed index only numbers the rows."""
    named = [name for name in data.index.names if name is not None]
    if not named:
        return data
    try:
        return data.reset_index()
    except ValueError as error:
        raise DuplicateColumn(
            f"the index and a column are both named {quoted(str(named[0]))}; rename one of them, "
            "or call reset_index(drop=True)",
            column=str(named[0]),
        ) from error


def _described(data: pd.DataFrame) -> list[Column]:
    """Columns by their names; the levels of a MultiIndex are the rows of a header."""
    if data.columns.empty:
        return []
    levels = data.columns.to_frame(index=False).fillna("").astype(str)
    header = tuple(tuple(levels.iloc[:, level]) for level in range(levels.shape[1]))
    columns = read_columns(header)
    for index, kind in enumerate(data.dtypes):
        if kind.kind in "mM" and not columns[index].unit_texts:
            columns[index] = describe_column(index, columns[index].texts, ["s"])
    return columns


def _cells(values: pd.Series, channel: Channel) -> NDArray[np.generic]:
    """The cells as numbers in the unit of the column, or as dates or durations."""
    if values.dtype.kind in "mM":
        return values.to_numpy(f"{values.dtype.kind}8[ns]")
    if channel.is_direction and values.dtype.kind not in "biuf":
        label = channel.column.label
        return np.array([direction_of(str(cell), label, row) for row, cell in enumerate(values)])
    numbers = pd.to_numeric(values, errors="coerce")
    faulty = np.flatnonzero(numbers.isna() & values.notna())
    if faulty.size or numbers.dtype.kind not in "biuf":
        sample = int(faulty[0]) if faulty.size else 0
        raise NotANumber(
            f"{quoted(str(values.iloc[sample]))} is not a number; expected a number in "
            f"{channel.unit.name}",
            row=sample,
            column=channel.column.label,
            value=str(values.iloc[sample]),
        )
    kind = numbers.dtype.kind
    is_whole = kind in "iu" and not numbers.hasnans
    return numbers.to_numpy(f"{kind}8" if is_whole else np.float64, na_value=np.nan)
