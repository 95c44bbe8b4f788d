"""Measured run of one motor, in SI units, checked; its warnings, source positions and writer.

All later stages take a `Run` and rely on the properties documented here; none of them parses,
converts or repairs data.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from html import escape
from typing import TypeVar

import numpy as np
import pandas as pd

from identification.arrays import Array, Bool
from identification.errors import Example, RunFileError
from identification.ingest.pulses import Pulses

__all__ = ["Run", "RunWarning", "Source", "SourceLocator", "write_run"]

Error = TypeVar("Error", bound=RunFileError)


@dataclass(frozen=True)
class RunWarning:
    """Warning about a run, for the reader of the result.

    `code` is a stable identifier such as ``clipped_channel``; `message` is one sentence with the
    values.
    """

    code: str
    message: str
    file: str
    row: int | None = None
    column: str | None = None

    def __str__(self) -> str:
        """File, column and message on one line, like an error: ``run3.csv, column n: ...``.

        The row is omitted: it marks only the first occurrence, and most warnings concern the whole
        column.
        """
        return f"{self.file}{f', column {self.column}' if self.column else ''}: {self.message}"


@dataclass(frozen=True)
class SourceLocator:
    """Source position (file, row, column) of a channel and a sample, for errors and warnings."""

    file: str
    """Name of the file in messages."""
    columns: Mapping[str, str]
    """Channel name to header text."""
    row: Callable[[int], int]
    """Function from sample index to row in the file."""
    derived: Mapping[str, str] = field(default_factory=dict)
    """Channel name to the channel from which it is derived; both have one column."""

    def error(
        self,
        kind: type[Error],
        message: str,
        channel: str,
        sample: int,
        value: object,
        examples: Sequence[Example] = (),
    ) -> Error:
        """Make an error of class `kind` located at one cell."""
        return kind(
            message,
            file=self.file,
            row=self.row(sample),
            column=self.columns.get(channel, channel),
            value=value,
            examples=examples,
        )

    def warning(
        self, code: str, message: str, channel: str | None = None, sample: int | None = None
    ) -> RunWarning:
        """Make a warning located at a file, a column or one cell."""
        row = None if sample is None else self.row(sample)
        column = None if channel is None else self.columns.get(channel, channel)
        return RunWarning(code, message, self.file, row, column)


@dataclass(frozen=True)
class Source:
    """Source column of a channel; its value in `unit` is ``cell * scale + offset``.

    `method` is ``linear`` or ``hold`` for a channel brought to the clock of another one,
    ``difference`` for a speed derived from the angle, ``duty`` for a voltage that is duty cycle
    times bus voltage, else None.  `period` is the change of the cell after which an angle starts
    again, and `sign` the column of directions by which the cell is multiplied.  The `method` of a
    channel without a column is ``constant``, with its `value` in `unit`, or ``row``, the number of
    the sample.
    """

    header: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    period: float | None = None
    sign: str | None = None
    value: float | None = None
    method: str | None = None

    @property
    def origin(self) -> str | None:
        """Channel from which this one is derived; None for a logged one."""
        return {"difference": "position_rad", "duty": "duty"}.get(self.method or "")

    @property
    def cell(self) -> str:
        """The cell as a ``--map`` argument gives it: the column, times that of its sign."""
        return self.header if self.sign is None else f"{self.header} * {self.sign}"

    def entry(self) -> dict[str, object]:
        """The source as plain data: the keys of a mapping, and the method if any."""
        entry = {"column": self.header, **asdict(self)}
        del entry["header"]
        return {key: value for key, value in entry.items() if value is not None}


@dataclass(frozen=True)
class Run:
    """One run of one motor."""

    name: str
    """File name as given by the user, without directories."""
    sha256: str
    time: Array
    """(n_sample,) strictly increasing [s]."""
    voltage: Array
    """(n_sample,) [V]."""
    current: Array
    """(n_sample,) [A]."""
    speed: Array
    """(n_sample,) [rad/s]."""
    temperature: Array | None = None
    """(n_sample,) [degC], or None if not recorded."""
    position: Array | None = None
    """(n_sample,) [rad], or None if not recorded."""
    segments: tuple[tuple[int, int], ...] = ()
    """Half-open sample ranges between gaps in the record; a run without gaps has one, ``((0,
    n_sample),)``.  The motor state is continuous within a segment only."""
    clipped: dict[str, Bool] = field(default_factory=dict)
    """Channel name to boolean (n_sample,), True where the sensor saturated."""
    held: dict[str, Bool] = field(default_factory=dict)
    """Channel name to boolean (n_sample,), True where no value was measured: between updates."""
    pulses: Pulses | None = None
    """Speeds at the times at which a pulse tachometer measured them; None for any other sensor."""
    warnings: tuple[RunWarning, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)
    """Channel name to source column; empty for a synthetic run."""
    direction: str | None = None
    """Unused column that may give the direction of rotation, by its name; None if there is none."""

    def __post_init__(self) -> None:
        if not self.segments:
            object.__setattr__(self, "segments", ((0, self.time.size),))

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def sample_rate_hz(self) -> float:
        """Sampling frequency, from the median sampling interval [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))

    @property
    def channels(self) -> dict[str, Array]:
        """Logged channels by canonical name: (n_sample,) in the unit of the name."""
        channels = {
            "voltage_V": self.voltage,
            "current_A": self.current,
            "speed_rad_s": self.speed,
            "temperature_degC": self.temperature,
            "position_rad": self.position,
        }
        return {name: values for name, values in channels.items() if values is not None}

    @property
    def joined(self) -> Bool:
        """(n_sample - 1,), True for an interval within a segment, False across a gap."""
        joined = np.zeros(self.rows - 1, dtype=bool)
        for start, stop in self.segments:
            joined[start : stop - 1] = True
        return joined

    @property
    def has_readings(self) -> bool:
        """False for a planned run, whose current and speed are both constant."""
        return bool(np.ptp(self.current) != 0.0 or np.ptp(self.speed) != 0.0)

    def omitted(self, name: str) -> Bool:
        """(n_sample,), True where a channel is no measurement: saturated, or between updates."""
        nowhere = np.zeros(self.rows, dtype=bool)
        return self.clipped.get(name, nowhere) | self.held.get(name, nowhere)

    def between_updates(self, name: str) -> Array:
        """(n_sample,) channel of a canonical name, interpolated linearly where it is held."""
        if name == "speed_rad_s" and self.pulses is not None:
            return np.interp(self.time, self.pulses.times, self.pulses.speeds)
        signal, held = self.channels[name], self.held.get(name)
        if held is None:
            return signal
        return np.interp(self.time, self.time[~held], signal[~held])

    def used(self, name: str) -> Array:
        """(n_sample,) channel of a canonical name, NaN where its sensor saturated."""
        return np.where(self.clipped.get(name, False), np.nan, self.channels[name])

    def table(self) -> pd.DataFrame:
        """The samples in canonical columns and SI units; unlogged channels have no column."""
        return pd.DataFrame({"time_s": self.time, **self.channels})

    def __repr__(self) -> str:
        channels = ", ".join(self.channels)
        return (
            f"Run({self.name!r}: {self.rows} samples at {self.sample_rate_hz:.4g} Hz, {channels})"
        )

    def _repr_html_(self) -> str:
        """Name, ranges of the channels and warnings, for notebooks."""
        ranges = self.table().agg(["min", "median", "max"]).T
        warnings = "".join(f"<li>{escape(str(warning))}</li>" for warning in self.warnings)
        return (
            f"<p><b>{escape(self.name)}</b>: {self.rows} samples at {self.sample_rate_hz:.4g} Hz"
            f"</p>{ranges.to_html(float_format='{:.4g}'.format)}<ul>{warnings}</ul>"
        )


def write_run(run: Run, path: str | os.PathLike[str]) -> None:
    """Write a run in canonical columns and SI units; the values read back bit for bit.

    Segments, omitted samples and warnings are recomputed on reading.
    """
    # The shortest decimal that reads back as the same float, whatever the ending of the path.
    run.table().to_csv(path, index=False, lineterminator="\n", compression=None)
