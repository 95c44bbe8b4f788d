"""Channels with clocks of their own, brought together on one of them.

The clock of the voltage is used, because the voltage is the input of the model and stays as logged;
only if current or speed is logged faster by more than `_RATE_RATIO`, the clock of the fastest.
The other channels follow by a stated method: a voltage keeps its previous value, any other channel
is interpolated linearly.  Nothing is extrapolated and no gap is bridged, except by a temperature.
A union of all clocks would repeat slow channels at times at which nothing was measured.

A table with a row for each message, as of a CAN bus, has blank cells where a channel was not sent;
a channel without a value in at least a third of the rows has the times of its values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arrays import Array
from identification.errors import BackwardTime, MissingValue, NoRows, RaggedRow
from identification.ingest.channels import Channel
from identification.ingest.columns import Column, describe_column
from identification.ingest.reader import Samples, numbers
from identification.ingest.run import RunWarning
from identification.ingest.timing import find_gaps

__all__ = [
    "Signal",
    "SignalTable",
    "apart",
    "brought_together",
    "is_apart",
    "joined",
    "refuse_shorter",
]

_RATE_RATIO = 1.5
_ROUNDED = 1e-6
"""Difference of two times over the sample interval that is a rounding error."""
_MEASURED = ("voltage_V", "current_A", "speed_rad_s")
_HELD = ("voltage_V", "duty", "bus_voltage_V")
_FEWEST_BLANKS = 1.0 / 3.0
"""Fraction of blank cells from which a channel has a clock of its own; fewer are lost values."""


@dataclass(frozen=True)
class Signal:
    """One logged signal."""

    names: tuple[str, ...]
    """Its names; the first is its title."""
    unit: str
    """Its unit as the file gives it; empty if there is none."""
    clock: Callable[[], Array]
    """Function that returns its sample times, (n_sample,) [s]."""
    load: Callable[[], ArrayLike]
    """Function that returns its samples, (n_sample,)."""
    attenuation: float = 1.0
    """Probe attenuation that the samples contain [-]."""
    rows: Callable[[int], int] | None = None
    """Function from sample index to row in the file; None for 1, 2, ..."""

    def row(self, sample: int) -> int:
        """Row of a sample in the file."""
        return sample + 1 if self.rows is None else self.rows(sample)


@dataclass(frozen=True)
class SignalTable:
    """Source table of signals, whose first column is the common time."""

    signals: Sequence[Signal]
    file: str
    warnings: tuple[RunWarning, ...] = ()
    time_unit: str = "s"
    """Unit of the clocks; blank if the file does not give it."""

    @cached_property
    def columns(self) -> Sequence[Column]:
        """The common time, then the signals."""
        columns = [describe_column(0, ["time"], [self.time_unit])]
        for index, signal in enumerate(self.signals, start=1):
            # A name with its group, as in "fast/speed", serves a mapping and is not parsed.
            column = describe_column(index, signal.names[-1:], [signal.unit])
            texts = tuple(dict.fromkeys(signal.names))
            columns.append(dataclasses.replace(column, texts=texts, attenuation=signal.attenuation))
        return columns

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Bring the channels to one clock.

        Raises:
            BackwardTime: The times of a channel do not increase.
            NoRows: The channels have no time in common.
        """
        used = {c.name: c for c in channels if c.column.index > 0}
        signals = {name: self.signals[c.column.index - 1] for name, c in used.items()}
        clocks = {name: signal.clock() for name, signal in signals.items()}
        cells = {name: numbers(signals[name].load(), c.column) for name, c in used.items()}
        _check_lengths(used, cells, clocks)
        base = _base(clocks)
        time = clocks[base]
        others = {n: t for n, t in clocks.items() if not np.array_equal(t, time, equal_nan=True)}
        kept = np.ones(time.size, dtype=bool)
        for name, clock in others.items():
            wrong = np.flatnonzero(~(np.diff(clock) > 0.0))
            if wrong.size:
                row = int(wrong[0]) + 1
                raise BackwardTime(
                    f"the time of the channel goes from {clock[row - 1]:.9g} {self.time_unit} to "
                    f"{clock[row]:.9g} {self.time_unit}; expected increasing times",
                    row=signals[name].row(row),
                    column=used[name].column.label,
                    value=float(clock[row]),
                )
            if not used[name].may_be_blank:
                kept &= _covered(time, clock)
        rows = np.flatnonzero(kept)
        if not rows.size:
            raise NoRows(
                f"{', '.join(used[n].column.label for n in others)} have no time in common with "
                f"{used[base].column.label}; expected channels of one run"
            )
        common = time[rows]
        methods = {}
        for name in used:
            if name in others:
                methods[name] = "hold" if _is_held(used[name]) else "linear"
                cells[name] = _brought(cells[name], others[name], common, used[name])
            else:
                cells[name] = cells[name][rows]
        if "time_s" not in cells:
            cells["time_s"] = common
        notes = self._notes(used, base, clocks, methods, time.size - rows.size)
        found = partial(_row, signals[base].row, rows)
        return Samples(cells, found, (*self.warnings, *notes), methods)

    def _notes(
        self,
        used: Mapping[str, Channel],
        base: str,
        clocks: Mapping[str, Array],
        methods: Mapping[str, str],
        omitted: int,
    ) -> Iterable[RunWarning]:
        """Warning that states the clock, the methods and the samples that were omitted."""
        if not methods:
            return
        parts = []
        for name, method in methods.items():
            how = "keeps its previous value" if method == "hold" else "is interpolated linearly"
            parts.append(
                f"{used[name].column.label} ({_interval(clocks[name], self.time_unit)}) {how}"
            )
        text = (
            f"the channels have different clocks; that of {used[base].column.label} "
            f"({_interval(clocks[base], self.time_unit)}) is used: {', '.join(parts)}"
        )
        if omitted:
            text += f"; {omitted} sample(s) at which a channel has a gap or no value are omitted"
        yield RunWarning("different_clocks", text, self.file)


def joined(
    groups: Mapping[str, Sequence[Signal]], file: str, warnings: tuple[RunWarning, ...] = ()
) -> SignalTable | None:
    """Table of several groups; a name that occurs several times gets its group in front."""
    names = [signal.names[-1] for signals in groups.values() for signal in signals]
    repeated = {name for name in names if names.count(name) > 1} if len(names) < 10_000 else set()
    every = [
        dataclasses.replace(signal, names=(f"{group}/{signal.names[-1]}", *signal.names))
        if signal.names[-1] in repeated
        else signal
        for group, signals in groups.items()
        for signal in signals
    ]
    return SignalTable(every, file, warnings) if len(groups) > 1 else None


def is_apart(cells: Array) -> bool:
    """Return True if a channel (n_sample,) has a value in some rows only, as of a CAN bus."""
    blanks = int(np.count_nonzero(np.isnan(cells)))
    return _FEWEST_BLANKS * cells.size <= blanks < cells.size


def apart(samples: Samples, channels: Sequence[Channel], file: str) -> Samples:
    """Bring channels with values in some rows of a table only to one clock.

    Raises:
        RunFileError: The times of a channel do not increase, or the channels have none in common.
        MissingValue: Only the first rows have a value of a channel.
    """
    if samples.methods:
        return samples
    refuse_shorter(samples, channels)
    used = [channel for channel in channels if channel.name != "time_s"]
    time = next((channel for channel in channels if channel.name == "time_s"), None)
    cells = [samples.cells[channel.name] for channel in used]
    is_one_clock = not any(
        is_apart(x) for x, c in zip(cells, used, strict=True) if not c.may_be_blank
    )
    if time is None or is_one_clock:
        return samples
    rows = [np.flatnonzero(~np.isnan(x) | np.all(np.isnan(x))) for x in cells]
    own = [(samples.cells["time_s"], at) for at in rows]
    return brought_together(samples, used, own, time, file)


def brought_together(
    samples: Samples,
    used: Sequence[Channel],
    own: Sequence[tuple[Array, NDArray[np.intp]]],
    time: Channel,
    file: str,
) -> Samples:
    """Channels of a table other than the time on one clock.

    Each has its `own` times (n_row,) and the rows that have a value; `time` gives their unit.
    """
    signals = [
        Signal(
            (),
            "",
            partial(np.take, clock, rows),
            partial(np.take, samples.cells[channel.name], rows),
            rows=partial(_row, samples.row, rows),
        )
        for channel, (clock, rows) in zip(used, own, strict=True)
    ]
    unit = time.unit.name if time.scale == 1.0 else ""
    table = SignalTable(signals, file, samples.warnings, unit)
    columns = [dataclasses.replace(c.column, index=k) for k, c in enumerate(used, 1)]
    return table.read(
        [dataclasses.replace(c, column=one) for c, one in zip(used, columns, strict=True)]
    )


def refuse_shorter(samples: Samples, channels: Sequence[Channel]) -> None:
    """Reject a channel with values in the first rows only, as of a group with times of its own.

    Raises:
        MissingValue: There is one.
    """
    for channel in channels:
        cells = samples.cells[channel.name]
        count = int(np.count_nonzero(~np.isnan(cells)))
        if is_apart(cells) and count > 1 and not np.any(np.isnan(cells[:count])):
            raise MissingValue(
                f"only the first {count} of {cells.size} rows have a value, which may belong to "
                "other times; name the time column of each group of columns alike, as in Time 1 "
                "[s] and Time 2 [s], export all channels at the same times, or cut the run there",
                row=samples.row(count),
                column=channel.column.label,
                examples=[{channel.name: None}] if channel.may_be_blank else [],
            )


def _row(row: Callable[[int], int], samples: NDArray[np.intp], sample: int) -> int:
    return row(int(samples[sample]))


def _base(clocks: Mapping[str, Array]) -> str:
    """Channel whose clock is used."""
    stand_ins = {"voltage_V": "duty", "speed_rad_s": "position_rad"}
    fast = [name if name in clocks else stand_ins.get(name, "") for name in _MEASURED]
    # A constant voltage has no clock.
    fast = [name for name in fast if name in clocks] or list(clocks)
    voltage_name = fast[0]
    intervals = {n: float(np.median(np.diff(clocks[n]))) for n in fast if clocks[n].size > 1}
    if not intervals:
        return voltage_name
    fastest = min(intervals, key=lambda name: intervals[name])
    voltage = intervals.get(voltage_name, np.inf)
    return voltage_name if voltage <= _RATE_RATIO * intervals[fastest] else fastest


def _check_lengths(
    used: Mapping[str, Channel], cells: Mapping[str, Array], clocks: Mapping[str, Array]
) -> None:
    for name, channel in used.items():
        if cells[name].shape != clocks[name].shape:
            raise RaggedRow(
                f"{cells[name].size} samples and {clocks[name].size} times; expected one time for "
                "each sample",
                column=channel.column.label,
            )
        if not cells[name].size:
            raise NoRows("the channel has no samples", column=channel.column.label)


def _covered(time: Array, clock: Array) -> NDArray[np.bool_]:
    """Mark the times inside the range of a clock and outside its gaps."""
    inside: NDArray[np.bool_] = (time >= clock[0]) & (time <= clock[-1])
    for gap in find_gaps(clock):
        inside &= (time <= clock[gap]) | (time >= clock[gap + 1])
    return inside


def _brought(cells: Array, clock: Array, time: Array, channel: Channel) -> Array:
    """Samples of a channel at the times of another clock."""
    if _is_held(channel):
        # Times in another unit differ by rounding, and a step must not come a sample late.
        rounding = _ROUNDED * float(clock[-1] - clock[0]) / clock.size
        return cells[np.searchsorted(clock, time + rounding, side="right") - 1]
    blank = np.isnan(cells)
    if channel.may_be_blank and np.any(blank) and not np.all(blank):
        clock, cells = clock[~blank], cells[~blank]
    return np.asarray(np.interp(time, clock, cells), dtype=np.float64)


def _is_held(channel: Channel) -> bool:
    return channel.name in _HELD or channel.is_direction


def _interval(clock: Array, unit: str) -> str:
    interval = f"{float(np.median(np.diff(clock))):.4g} {unit}" if clock.size > 1 else "one sample"
    return interval.rstrip()
