"""Groups of columns side by side in one table, each behind a time column of its own.

    Time 1 [s] | Voltage [V] | Current [A] | Time 2 [s] | Speed [1/min] | Temperature [degC]

Loggers with several sample rates (catman, DIAdem) and plots exported curve by curve have such
tables.  A channel has the clock of the nearest time column to its left; a shorter group ends with
blank cells.  The titles of the time columns are the same but for number, rate and unit: the time of
day or of another device has another zero, and its name says so.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Bool
from identification.errors import NoRows
from identification.ingest.channels import Channel
from identification.ingest.clocks import Signal, SignalTable
from identification.ingest.columns import Column
from identification.ingest.reader import Samples, SourceTable, TableSet, blank_cell
from identification.ingest.units import Unit, canonical_unit, find_unit

__all__ = ["with_own_clocks"]

_ROUNDED: Final = 1e-3
"""Difference of two times over the sample interval below which they are the same."""


def with_own_clocks(opened: SourceTable | TableSet, file: str) -> SourceTable | TableSet:
    """The table or tables of a file, each group of columns on the clock to its left."""
    if isinstance(opened, TableSet):
        tables = {name: _grouped(table, file) for name, table in opened.tables.items()}
        return dataclasses.replace(opened, tables=tables)
    return _grouped(opened, file)


def _grouped(table: SourceTable, file: str) -> SourceTable:
    columns = list(table.columns)
    places = [k for k, column in enumerate(columns) if column.is_time]
    names = {_name(columns[k]) for k in places}
    has_groups = len(places) > 1 and places[0] == 0 and len(names) == 1
    if not has_groups or any(b - a < 2 for a, b in pairwise([*places, len(columns)])):
        return table
    return _SideBySide(table, tuple(columns[k] for k in places), file)


def _name(column: Column) -> str:
    """Title without number, rate and unit: ``time`` of "Time 1 - slow [s]" and of "time_ms"."""
    words = re.findall(r"[^\W\d_]+", re.split(r" - |[\[(/]", column.title)[0])
    units = [find_unit(word) for word in words]
    own = [w for w, unit in zip(words, units, strict=True) if unit is None]
    return " ".join(own).casefold()


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
        first = dataclasses.replace(self.times[0], quantities=frozenset({"time"}))
        return [first, *(c for c in self.table.columns if c not in self.times)]

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
        clocks = [Channel(f"time {k}", self.times[k], _unit(self.times[k])) for k in needed]
        found = self.table.read([_in_group(c) for c in (*clocks, *used)])
        times = {
            k: found.cells[clock.name] * (clock.unit.factor / _unit(time.column).factor)
            for k, clock in zip(needed, clocks, strict=True)
        }
        times = {k: _same(clock, times[needed[0]]) for k, clock in times.items()}
        rows = {k: np.flatnonzero(~np.isnan(clock)) for k, clock in times.items()}
        self._refuse_apart({k: clock[rows[k]] for k, clock in times.items()})
        signals = []
        for channel, group in zip(used, groups, strict=True):
            cells, is_timed = found.cells[channel.name], ~np.isnan(times[group])
            _refuse_blanks(clocks[needed.index(group)], ~is_timed & ~np.isnan(cells), found)
            if not channel.may_be_blank:
                _refuse_blanks(channel, is_timed & np.isnan(cells), found)
            clock = partial(np.take, times[group], rows[group])
            load = partial(np.take, cells, rows[group])
            signals.append(Signal((), "", clock, load, rows=partial(_row, found, rows[group])))
        unit = time.unit.name if time.scale == 1.0 else ""
        table = SignalTable(signals, self.file, found.warnings, unit)
        return table.read([_numbered(channel, k) for k, channel in enumerate(used, 1)])

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


def _unit(column: Column) -> Unit:
    unit = column.unit
    return unit if unit is not None and unit.quantity == "time" else canonical_unit("time_s")


def _same(clock: Array, other: Array) -> Array:
    """The other clock if both differ by rounding only, as in another unit; else the clock."""
    steps = np.diff(other[~np.isnan(other)])
    tolerance = _ROUNDED * float(np.median(steps)) if steps.size else 0.0
    return other if np.allclose(clock, other, 0.0, tolerance, equal_nan=True) else clock


def _in_group(channel: Channel) -> Channel:
    """The channel for the reader of the table, which accepts the blank end of its group."""
    return dataclasses.replace(channel, may_end=True)


def _numbered(channel: Channel, index: int) -> Channel:
    return dataclasses.replace(channel, column=dataclasses.replace(channel.column, index=index))


def _refuse_blanks(channel: Channel, lost: Bool, samples: Samples) -> None:
    if lost.any():
        raise blank_cell(channel, samples.row(int(np.argmax(lost))))


def _row(samples: Samples, rows: NDArray[np.intp], sample: int) -> int:
    return samples.row(int(rows[sample]))
