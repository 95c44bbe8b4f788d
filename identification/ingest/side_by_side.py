"""Groups of columns side by side in one table, each behind a time column of its own.

    Time 1 [s] | Voltage [V] | Current [A] | Time 2 [s] | Speed [1/min] | Temperature [degC]

Loggers with several sample rates (catman, DIAdem) and plots exported curve by curve have such
tables.  A channel has the clock of the nearest time column to its left; a shorter group ends with
blank cells.  The titles of the time columns are the same but for number, rate, unit and channel:
the time of day or of another device has another zero, and its name says so.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.errors import NoRows
from identification.ingest.channels import Channel, header_unit
from identification.ingest.clocks import brought_together
from identification.ingest.columns import Column, describe_column
from identification.ingest.frame import Frame
from identification.ingest.names import is_sample_number
from identification.ingest.reader import ColumnTable, Samples, SourceTable, TableSet, blank_cell
from identification.ingest.text.long import long_table, roles_of
from identification.ingest.units import Unit, find_unit

__all__ = ["with_own_clocks"]

_WORD: Final = re.compile(r"[^\W\d_]+")
_ABSCISSAE: Final = ("x", "x value", "x values", "abscissa")
_NO_UNIT: Final = re.compile(r"[\d.]+ ?(k?hz)?", re.IGNORECASE)
"""Number or rate in the brackets of a title."""
_ROUNDED: Final = 1e-3
"""Difference of two times over the sample interval below which they are the same."""


def with_own_clocks(opened: SourceTable | TableSet, file: str) -> SourceTable | TableSet:
    """The table or tables of a file, with one signal per row or a clock for each group."""
    if isinstance(opened, TableSet):
        tables = {name: _grouped(table, file) for name, table in opened.tables.items()}
        return dataclasses.replace(opened, tables=tables)
    return _grouped(opened, file)


def _grouped(table: SourceTable, file: str) -> SourceTable:
    columns = list(table.columns)
    roles = roles_of([column.title for column in columns])
    if roles is not None and isinstance(table, ColumnTable | Frame):
        offset = 1 if isinstance(table, ColumnTable) else 0
        return long_table(columns, roles, table.load, file, offset)
    named = [_named(column, columns[k : k + 1]) for k, column in enumerate(columns, 1)]
    places = [k for k, column in enumerate(columns) if column.is_time or _is_time(named[k])]
    if columns[0].texts and not (places or columns[0].quantities or columns[0].unit_texts):
        # X_Value or a counter in front of each channel; a mapping gives its unit or interval.
        first = named[0].title
        is_known = first.casefold() in _ABSCISSAE or is_sample_number(first)
        titled = named if is_known else columns
        places = [k for k, column in enumerate(titled) if column.texts == titled[0].texts]
    is_numbered = len(places) == 1 and "time" not in columns[0].quantities and _is_time(named[0])
    has_groups = len(places) > 1 or is_numbered
    has_groups &= places[:1] == [0] and len({named[k].texts for k in places}) == 1
    if not has_groups or any(b - a < 2 for a, b in pairwise([*places, len(columns)])):
        return table
    times = (dataclasses.replace(named[k], texts=columns[k].texts) for k in places)
    return _SideBySide(table, tuple(times), file)


def _named(column: Column, right: Sequence[Column]) -> Column:
    """The column by its title without number, rate, unit and the channel to its right.

    ``Time`` of "Time 1 - slow [s]", of "time_2_ms", of "Time [s].1" and of "Voltage time", each
    with its unit.
    """
    channel = [word for other in right for word in _WORD.findall(other.title.casefold())]
    front = _WORD.findall(re.split(r" - |[\[(/]", column.title)[0])
    units = {word: find_unit(word) for word in _WORD.findall(column.title)}
    # The case of t and T differs in meaning.
    words = [w if len(w) == 1 else w.casefold() for w in front if units[w] is None]
    name = " ".join(w for w in words if w not in channel and w not in ("hz", "khz"))
    written = [unit.name for unit in units.values() if unit and unit.quantity == "time"]
    stated = [text for text in column.unit_texts if not _NO_UNIT.fullmatch(text)] or written[:1]
    return describe_column(column.index, [name], stated)


def _is_time(column: Column) -> bool:
    return column.quantities == {"time"}


@dataclasses.dataclass(frozen=True)
class _SideBySide:
    """Table whose groups are brought to one clock."""

    table: SourceTable
    times: tuple[Column, ...]
    """Time column of each group, from left to right."""
    file: str

    @property
    def columns(self) -> Sequence[Column]:
        """The first time column, which stands for the common time, and all channels."""
        first = self.times[0]
        if first.is_time:
            first = dataclasses.replace(first, quantities=frozenset({"time"}))
        clocks = {time.index for time in self.times}
        return [first, *(c for c in self.table.columns if c.index not in clocks)]

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Bring the channels to one clock.

        Raises:
            MissingValue: A cell is blank before the end of its group.
            NoRows: Two groups have no time in common.
            RunFileError: Cells are faulty, or the times of a group do not increase.
        """
        first = self.times[0].index
        time = next((c for c in channels if c.name == "time_s" and c.column.index == first), None)
        if time is None:
            return self.table.read(channels)
        used = [channel for channel in channels if channel is not time]
        groups = [self._group(channel.column) for channel in used]
        needed = sorted(set(groups))
        clocks = [Channel(f"time {k}", self.times[k], self._unit(k, time)) for k in needed]
        read = [dataclasses.replace(c, may_end=True) for c in (*clocks, *used)]
        found = self.table.read(read)
        length = max(cells.size for cells in found.cells.values())
        for name, cells in found.cells.items():
            found.cells[name] = np.append(cells, np.full(length - cells.size, np.nan))
        own = self._unit(0, time).factor
        times = {
            k: found.cells[clock.name] * (clock.unit.factor / own)
            for k, clock in zip(needed, clocks, strict=True)
        }
        times = {k: _same(clock, times[needed[0]]) for k, clock in times.items()}
        rows = {k: np.flatnonzero(~np.isnan(clock)) for k, clock in times.items()}
        self._refuse_apart({k: clock[rows[k]] for k, clock in times.items()})
        clocked = []
        for channel, group in zip(used, groups, strict=True):
            cells, is_timed = found.cells[channel.name], ~np.isnan(times[group])
            _refuse_blanks(clocks[needed.index(group)], ~is_timed & ~np.isnan(cells), found)
            if not channel.may_be_blank:
                _refuse_blanks(channel, is_timed & np.isnan(cells), found)
            clocked.append((times[group], rows[group]))
        return brought_together(found, used, clocked, time, self.file)

    def _refuse_apart(self, clocks: Mapping[int, Array]) -> None:
        """Reject a group that was recorded before or after the first one."""
        timed = [k for k, clock in clocks.items() if clock.size]
        for k in timed[1:]:
            first = timed[0]
            begin, end = clocks[first][[0, -1]]
            if clocks[k][0] > end or clocks[k][-1] < begin:
                raise NoRows(
                    f"its times, {clocks[k][0]:.6g} to {clocks[k][-1]:.6g}, and those of "
                    f"{self.times[first].label}, {begin:.6g} to {end:.6g}, have no time in common; "
                    "expected channels of one run",
                    column=self.times[k].label,
                )

    def _group(self, column: Column) -> int:
        """Number of the time column to the left of a channel."""
        return sum(time.index < column.index for time in self.times) - 1

    def _unit(self, group: int, time: Channel) -> Unit:
        """Unit of the times of a group: its own, else that of the first, else of the mapping."""
        column, first = self.times[group], self.times[0]
        if column.unit_texts and column.unit_texts != first.unit_texts:
            return header_unit("time_s", column)
        if first.unit is not None and first.unit.quantity == "time":
            return first.unit
        return dataclasses.replace(time.unit, factor=time.scale * time.unit.factor)


def _same(clock: Array, other: Array) -> Array:
    """The other clock if both differ by rounding only, as in another unit; else the clock."""
    steps = np.diff(other[~np.isnan(other)])
    tolerance = _ROUNDED * float(np.median(steps)) if steps.size else 0.0
    return other if np.allclose(clock, other, 0.0, tolerance, equal_nan=True) else clock


def _refuse_blanks(channel: Channel, lost: Bool, samples: Samples) -> None:
    if lost.any():
        raise blank_cell(channel, samples.row(int(np.argmax(lost))))
