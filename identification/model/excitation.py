"""Records: gap-free segments of runs, as inputs and measured outputs of a simulation.

The inputs of a record are known functions of time that drive the simulation.  Its outputs are the
measured current and speed, with which the simulation is compared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.ingest.run import Run
from identification.model.composite import INPUTS, Edges
from identification.model.logged_temperature import coarse_step, smooth_temperature
from identification.model.logged_voltage import smooth_voltage
from identification.model.unlogged import RAMP
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["Record", "records_of", "rms_of", "sample_interval", "squares_of"]

_MANY: Final = 10
"""Edges lose their weight only in records longer than this multiple of them."""


@dataclass(frozen=True)
class Record:
    """One segment of one run."""

    run: int
    """Index of the run in the order of recording."""
    name: str
    """File name of the run."""
    start: int
    """Index of the segment's first sample in its run."""
    time: Array
    """(n_sample,) time since the start of the run [s]."""
    inputs: Array
    """(n_sample, n_input) in the order of `INPUTS`; the last interval has zero length."""
    measured: Array
    """(n_sample, 2) logged current and speed, interpolated where held [A, rad/s]."""
    weight: Array
    """(n_sample, 2) sample weights: 0 where a channel was clipped or held, else 1; `within`
    rescales them."""
    angle_logged: bool = False
    """True if the angle was logged; else it is the integral of the logged speed."""
    expected: float | None = None
    """Expected temperature of a run without a logged one, else None [degC].  The temperature input
    is then a ramp by `RAMP` around this value."""
    whole: Array | None = None
    """(n_sample, 2) weights before `within` removed the edges; None if it removed none."""
    resolution: float = 0.0
    """Step that the logged temperature leaves unknown, zero if noise dithers it [K]."""
    raw_angle: Array | None = None
    """(n_sample,) angle before `with_angle` corrected it; None if it did not [rad]."""
    voltage_noise: Array | None = None
    """(n_sample,) random series like the noise that is left in a smoothed voltage [V]; None if the
    voltage is as logged."""
    duration: float = 0.0
    """Duration of the whole record, of which this may be a segment [s]."""
    coarse_log: Array | None = None
    """(n_sample,) logged temperature, if its steps are not dithered by noise [degC]."""

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def interval(self) -> float:
        """Longest sample interval [s]."""
        return float(self.column("interval").max())

    @cached_property
    def head(self) -> Array:
        """Initial current and speed (2,), the median of the first three samples [A, rad/s]."""
        return np.asarray(np.median(self.measured[:3], axis=0))

    @cached_property
    def span(self) -> Array:
        """Range plus largest magnitude of current and speed (2,), never zero [A, rad/s]."""
        size = np.ptp(self.measured, axis=0) + np.abs(self.measured).max(axis=0)
        return np.where(size > 0, size, 1.0)

    @cached_property
    def levels(self) -> tuple[Array, Array]:
        """Constant stretches of a coarse temperature log: mean times and errors, each (n_level,).

        Times are since the start of the run [s]; an error is the level minus the mean of the
        temperature input [K].
        """
        log = np.empty(0) if self.coarse_log is None else self.coarse_log
        begin = np.flatnonzero(np.diff(log, prepend=np.nan) != 0.0)
        if not begin.size:
            return np.empty(0), np.empty(0)
        count = np.diff(np.append(begin, log.size))
        mean = np.add.reduceat(self.column("temperature"), begin) / count
        return np.add.reduceat(self.time, begin) / count, log[begin] - mean

    def column(self, name: str) -> Array:
        """One input (n_sample,) by name."""
        return self.inputs[:, INPUTS.index(name)]

    def segment(self, start: int, rows: int) -> Record:
        """At most `rows` samples from `start` or at the end; the last interval has zero length."""
        if rows >= self.rows:
            return self
        start = min(start, self.rows - rows)
        part = self.at(slice(start, start + rows))
        inputs = part.inputs.copy()
        inputs[-1, 0] = 0.0
        return replace(part, start=self.start + start, inputs=inputs)

    def at(self, rows: slice) -> Record:
        """Some of the samples; the intervals, which remain, may not fit them."""

        def kept(series: Array | None) -> Array | None:
            return None if series is None else series[rows]

        return replace(
            self, time=self.time[rows], inputs=self.inputs[rows], measured=self.measured[rows],
            weight=self.weight[rows], whole=kept(self.whole), raw_angle=kept(self.raw_angle),
            voltage_noise=kept(self.voltage_noise), coarse_log=kept(self.coarse_log),
        )  # fmt: skip

    @property
    def integrated(self) -> Array:
        """(n_sample,) angle before any correction, logged or integrated from the speed [rad]."""
        return self.column("angle") if self.raw_angle is None else self.raw_angle

    def with_smooth_voltage(self) -> Record:
        """The record with the noise of its voltage removed."""
        smooth, left = smooth_voltage(self.column("voltage"))
        return replace(self.with_inputs(_voltage_columns(smooth)), voltage_noise=left)

    def with_voltage_noise(self, shift: int = 0) -> Record:
        """The record with as much noise added to its voltage as is left, shifted by samples."""
        if self.voltage_noise is None:
            return self
        noise = np.roll(self.voltage_noise, shift)
        return self.with_inputs(_voltage_columns(self.column("voltage") + noise))

    def with_inputs(self, columns: Mapping[str, Array]) -> Record:
        """The record with other inputs (n_sample,) by name."""
        inputs = self.inputs.copy()
        for name, column in columns.items():
            inputs[:, INPUTS.index(name)] = column
        return replace(self, inputs=inputs)

    def with_angle(self, angle: Array) -> Record:
        """The record with another angle, (n_sample,) [rad]."""
        turned = self.with_inputs(_angle_columns(angle))
        return replace(turned, raw_angle=self.integrated.copy())

    def within(self, edges: Edges) -> Record:
        """Remove the weight of the edge samples and scale up the other weights to the same sum.

        This makes models with delays or averages, which cannot predict the edges, comparable with
        other models.  A record that is not much longer than its edges, the numbers of samples at
        start and end of each channel, keeps them.
        """
        whole = self.weight if self.whole is None else self.whole
        if not any(any(pair) for pair in edges):
            return self if self.whole is None else replace(self, weight=whole, whole=None)
        weight = whole.copy()
        for channel, (first, last) in enumerate(edges):
            if self.rows > _MANY * (first + last):
                inner = whole[first : self.rows - last, channel]
                # A channel that has weight only at its edges keeps it.
                if inner.sum() > 0:
                    weight[:, channel] = 0.0
                    weight[first : self.rows - last, channel] = inner * (
                        whole[:, channel].sum() / inner.sum()
                    )
        return replace(self, weight=weight, whole=whole)


def records_of(
    runs: Sequence[Run],
    first: int = 0,
    hottest: float = -np.inf,
    expected: float = REFERENCE_TEMPERATURE_DEGC,
) -> list[Record]:
    """Records of the runs, in the order of recording.

    If other runs were recorded before, `first` is the index of the first run and `hottest` the
    highest temperature logged until then [degC]; `expected` is that of runs without a logged one
    [degC].
    """
    records: list[Record] = []
    peak = hottest
    for k, run in enumerate(runs):
        coarse, bare, unknown = 0.0, None, None
        if run.temperature is None:
            unknown = expected
            whole = max(float(run.time[-1] - run.time[0]), 1e-300)
            temperature = expected + RAMP * ((run.time - run.time[0]) / whole - 0.5)
            highest = np.full(run.time.size, peak if np.isfinite(peak) else expected)
        else:
            coarse, is_bare = coarse_step(run.temperature)
            bare = run.temperature if is_bare else None
            temperature = smooth_temperature(run.time, run.temperature, run.segments)
            highest = np.maximum.accumulate(np.maximum(temperature, peak))
            peak = float(highest[-1])
        for start, stop in run.segments:
            if stop - start >= 2:
                made = _record(run, first + k, start, stop, temperature, highest)
                log = None if bare is None else bare[start:stop]
                records.append(replace(made, expected=unknown, resolution=coarse, coarse_log=log))
    return records


def _record(
    run: Run, number: int, start: int, stop: int, temperature: Array, highest: Array
) -> Record:
    span = slice(start, stop)
    time = run.time[span] - run.time[0]
    interval = np.append(np.diff(time), 0.0)
    current, speed = (run.between_updates(name)[span] for name in ("current_A", "speed_rad_s"))
    if run.position is not None:
        angle = run.position[span]
    else:
        moved = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
        angle = np.concatenate([[0.0], np.cumsum(moved)])

    columns = {
        "interval": interval,
        **_voltage_columns(run.voltage[span]),
        "temperature": temperature[span],
        "temperature_next": np.append(temperature[span][1:], temperature[span][-1]),
        **_angle_columns(angle),
        "time": time,
        "run": np.full(time.size, float(number)),
        "peak_temperature": highest[span],
        "substep": np.zeros(time.size),
        "substeps": np.ones(time.size),
        "temperature_rate": np.zeros(time.size)
        if run.temperature is None
        else np.gradient(temperature[span], time),
    }
    omitted = [run.omitted(name)[span] for name in ("current_A", "speed_rad_s")]
    weight = np.where(np.column_stack(omitted), 0.0, 1.0)
    return Record(
        run=number, name=run.name, start=start, time=time,
        inputs=np.column_stack([columns[name] for name in INPUTS]),
        measured=np.column_stack([current, speed]), weight=weight,
        angle_logged=run.position is not None, duration=float(time[-1] - time[0]),
    )  # fmt: skip


def sample_interval(records: Sequence[Record]) -> float:
    """Median sample interval of all records [s]."""
    return float(np.median(np.concatenate([record.inputs[:-1, 0] for record in records])))


def squares_of(records: Sequence[Record], differences: Sequence[Array]) -> Array:
    """(2,) weighted sum of the squares of differences, (n_sample, 2) of each record."""
    parts = zip(records, differences, strict=True)
    sums = [np.sum(record.weight * each**2, axis=0) for record, each in parts]
    return np.asarray(np.sum(sums, axis=0))


def rms_of(records: Sequence[Record], differences: Sequence[Array]) -> Array:
    """(2,) weighted RMS of differences, (n_sample, 2) of each record; zero without weight."""
    weight = np.sum([record.weight.sum(axis=0) for record in records], axis=0)
    return np.asarray(np.sqrt(squares_of(records, differences) / np.maximum(weight, 1.0)))


def _voltage_columns(voltage: Array) -> dict[str, Array]:
    """Inputs that depend on the voltage (n_sample,) [V]."""
    return {"voltage": voltage, "voltage_next": np.append(voltage[1:], voltage[-1])}


def _angle_columns(angle: Array) -> dict[str, Array]:
    """Inputs that depend on the angle (n_sample,) [rad]."""
    return {
        "angle": angle,
        "angle_next": np.append(angle[1:], angle[-1]),
        "turn": np.append(np.diff(angle), 0.0),
    }
