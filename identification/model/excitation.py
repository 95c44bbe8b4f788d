"""Records: gap-free segments of runs, as inputs and measured outputs of a simulation.

The inputs of a record are known functions of time that drive the simulation.  Its outputs are the
measured current and speed, with which the simulation is compared.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.ingest.run import Run
from identification.model.composite import INPUTS
from identification.model.unlogged import RAMP
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["Record", "records_of", "smooth_temperature"]

Array = NDArray[np.float64]

_MANY: Final = 10
"""Edges lose their weight only in records longer than this multiple of them."""
_KNOTS: Final = 200
_EDGE: Final = 20
"""Samples on either side of a gap whose medians are compared."""
_LEAST_STEP_K: Final = 1.0
_STEP_ERRORS: Final = 6.0
_STIFFNESSES: Final = np.geomspace(1e-3, 1e10, 80)


@dataclass(frozen=True)
class Record:
    """One segment of one run.

    Args:
        run: Index of the run in the order of recording.
        name: File name of the run.
        start: Index of the segment's first sample in its run.
        time: (n_sample,) time since the start of the run [s].
        inputs: (n_sample, n_input) in the order of `INPUTS`; the last interval has zero length.
        measured: (n_sample, 2) logged current and speed [A, rad/s].
        weight: (n_sample, 2) sample weights: 0 where the sensor was clipped, else 1; `within`
            rescales them.
        angle_logged: Whether the angle was logged; else it is the integral of the logged speed.
        expected: Expected temperature of a run without a logged one, else None [degC].  The
            temperature input is then a ramp by `RAMP` around this value.
        whole: (n_sample, 2) weights before `within` removed the edges; None if it removed none.
        resolution: Quantisation step of the logged temperature, zero if noise dithers it [K].
        duration: Duration of the whole record, of which this may be a segment [s].
    """

    run: int
    name: str
    start: int
    time: Array
    inputs: Array
    measured: Array
    weight: Array
    angle_logged: bool = False
    expected: float | None = None
    whole: Array | None = None
    resolution: float = 0.0
    duration: float = 0.0

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

    def column(self, name: str) -> Array:
        """One input (n_sample,) by name."""
        return self.inputs[:, INPUTS.index(name)]

    def segment(self, start: int, rows: int) -> Record:
        """At most `rows` samples from `start` or at the end; the last interval has zero length."""
        if rows >= self.rows:
            return self
        start = min(start, self.rows - rows)
        span = slice(start, start + rows)
        inputs = self.inputs[span].copy()
        inputs[-1, 0] = 0.0
        return replace(
            self,
            start=self.start + start,
            time=self.time[span],
            inputs=inputs,
            measured=self.measured[span],
            weight=self.weight[span],
            whole=None if self.whole is None else self.whole[span],
        )

    def within(self, edges: tuple[tuple[int, int], tuple[int, int]]) -> Record:
        """Remove the weight of the edge samples and scale up the other weights to the same sum.

        This makes models with delays or averages, which cannot predict the edges, comparable with
        other models.  A record that is not much longer than its edges keeps them.

        Args:
            edges: For each channel the number of samples at the start and at the end.
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

    Args:
        runs: The runs.
        first: Index of the first run, if other runs were recorded before.
        hottest: Highest temperature logged in those earlier runs [degC].
        expected: Expected temperature of runs without a logged one [degC].
    """
    records: list[Record] = []
    peak = hottest
    for k, run in enumerate(runs):
        coarse = _coarse_step(run)
        if run.temperature is None:
            temperature = expected + RAMP * _passed(run)
            highest = np.full(run.time.size, peak if np.isfinite(peak) else expected)
        else:
            temperature = smooth_temperature(run)
            highest = np.maximum.accumulate(np.maximum(temperature, peak))
            peak = float(highest[-1])
        for start, stop in run.segments:
            if stop - start >= 2:
                made = _record(run, first + k, start, stop, temperature, highest)
                unknown = expected if run.temperature is None else None
                records.append(replace(made, expected=unknown, resolution=coarse))
    return records


def _passed(run: Run) -> Array:
    """Elapsed fraction of the run minus one half, (n_sample,) [-]."""
    whole = max(float(run.time[-1] - run.time[0]), 1e-300)
    return np.asarray((run.time - run.time[0]) / whole - 0.5)


def _record(
    run: Run, number: int, start: int, stop: int, temperature: Array, highest: Array
) -> Record:
    span = slice(start, stop)
    time = run.time[span] - run.time[0]
    interval = np.append(np.diff(time), 0.0)
    speed = run.speed[span]
    if run.position is not None:
        angle = run.position[span]
    else:
        moved = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
        angle = np.concatenate([[0.0], np.cumsum(moved)])

    def following(x: Array) -> Array:
        return np.append(x[1:], x[-1])

    columns = {
        "interval": interval,
        "voltage": run.voltage[span],
        "voltage_next": following(run.voltage[span]),
        "temperature": temperature[span],
        "temperature_next": following(temperature[span]),
        "angle": angle,
        "angle_next": following(angle),
        "time": time,
        "run": np.full(time.size, float(number)),
        "peak_temperature": highest[span],
        "substep": np.zeros(time.size),
        "substeps": np.ones(time.size),
        "temperature_rate": np.zeros(time.size)
        if run.temperature is None
        else np.gradient(temperature[span], time),
    }
    clipped = [run.clipped.get(name) for name in ("current_A", "speed_rad_s")]
    weight = np.column_stack(
        [np.ones(time.size) if mask is None else 1.0 - mask[span] for mask in clipped]
    )
    return Record(
        run=number, name=run.name, start=start, time=time,
        inputs=np.column_stack([columns[name] for name in INPUTS]),
        measured=np.column_stack([run.current[span], speed]), weight=weight,
        angle_logged=run.position is not None, duration=float(time[-1] - time[0]),
    )  # fmt: skip


def smooth_temperature(run: Run) -> Array:
    """Logged temperature (n_sample,) without quantisation and noise, by Whittaker smoothing [degC].

    The temperature of a motor varies over many samples, while its logger resolves a tenth of a
    degree or a whole one.  The log is averaged over short spans, the averages are smoothed with a
    penalty chosen by generalised cross-validation, and a cubic spline interpolates them.  Segments
    are smoothed separately if the temperature jumps across the gap between them.  A run without a
    logged temperature is assumed to be at 25 degC throughout.
    """
    if run.temperature is None:
        return np.full(run.time.size, REFERENCE_TEMPERATURE_DEGC)
    quantum = _quantum(run.temperature)
    smooth = [
        _smooth_stretch(run.time[start:stop], run.temperature[start:stop], quantum)
        for start, stop in _stretches(run.temperature, run.segments, quantum)
    ]
    return np.concatenate(smooth)


def _quantum(logged: Array) -> float:
    """Smallest difference between distinct logged values, zero if all are equal [K]."""
    steps = np.diff(np.unique(logged))
    return float(steps.min()) if steps.size else 0.0


def _coarse_step(run: Run) -> float:
    """Quantisation step of the logged temperature, zero if noise dithers it [K]."""
    if run.temperature is None:
        return 0.0
    quantum = _quantum(run.temperature)
    _, _, within = _spans(run.temperature)
    return quantum if _is_hidden(within, quantum) else 0.0


def _stretches(
    logged: Array, segments: Sequence[tuple[int, int]], quantum: float
) -> list[tuple[int, int]]:
    """Segments, merged where the temperature is continuous across the gap between them."""
    joined = [segments[0]]
    for start, stop in segments[1:]:
        first = joined[-1][0]
        before, after = logged[max(first, start - _EDGE) : start], logged[start:stop][:_EDGE]
        noise = float(np.hypot(_median_error(before), _median_error(after)))
        step = abs(float(np.median(after)) - float(np.median(before)))
        if step > max(_LEAST_STEP_K, 2.0 * quantum, _STEP_ERRORS * noise):
            joined.append((start, stop))
        else:
            joined[-1] = (first, stop)
    return joined


def _median_error(values: Array) -> float:
    """Approximate standard error of the median of white noise, from first differences."""
    if values.size < 2:
        return 0.0
    return float(np.std(np.diff(values)) / np.sqrt(values.size))


def _smooth_stretch(clock: Array, logged: Array, quantum: float) -> Array:
    """Smoothed temperature of a stretch without jumps.

    Args:
        clock: (n_sample,) [s].
        logged: (n_sample,) [degC].
        quantum: Quantisation step of the logger [K].
    """
    edges, mean, within = _spans(logged)
    time = np.add.reduceat(clock, edges[:-1]) / np.diff(edges)
    if time.size < 8 or np.ptp(mean) == 0.0:
        return np.interp(clock, time, mean)
    hidden = quantum / np.sqrt(12.0) if _is_hidden(within, quantum) else 0.0
    # Natural end conditions: the extrapolation by half a span at either end is nearly linear.
    spline = CubicSpline(time, _smoothed(mean, hidden), bc_type="natural")
    return np.asarray(spline(clock), dtype=np.float64)


def _spans(logged: Array) -> tuple[NDArray[np.int64], Array, float]:
    """Edges of short spans, the mean of each, and the median standard deviation within one."""
    edges = np.unique(np.linspace(0, logged.size, min(_KNOTS, logged.size) + 1).astype(np.int64))
    count = np.diff(edges)
    mean = np.add.reduceat(logged, edges[:-1]) / count
    squares = np.add.reduceat(logged**2, edges[:-1]) / count
    return edges, mean, float(np.median(np.sqrt(np.maximum(squares - mean**2, 0.0))))


def _is_hidden(within: float, quantum: float) -> bool:
    """Whether quantisation hides the signal between two quantisation levels.

    Noise above a tenth of the step dithers the log.  With less noise the span means have steps
    like the log itself, and cross-validation would fit the steps as signal.
    """
    return within < 0.1 * quantum


def _smoothed(series: Array, hidden: float) -> Array:
    """Whittaker smoother of evenly spaced values.

    The penalty is that of generalised cross-validation or, if larger, the largest one whose
    residual stays below `hidden`, the standard deviation of the quantisation error.  That error is
    correlated between neighbours, so cross-validation does not detect it.

    The eigenvectors of the penalty matrix diagonalise the smoother for every penalty, so the choice
    among all penalties costs one matrix-vector product.

    Source: Eilers, Analytical Chemistry 75 (2003), 3631-3636.
    """
    penalty, vectors = _penalty(series.size)
    projected = vectors.T @ series
    shrink = 1.0 / (1.0 + _STIFFNESSES[:, None] * penalty[None, :])
    squares = np.sum(((1.0 - shrink) * projected) ** 2, axis=1)
    freedom = series.size - shrink.sum(axis=1)
    score = squares / np.maximum(freedom, 1e-9) ** 2
    within = np.flatnonzero(squares <= series.size * hidden**2)
    best = max(int(np.argmin(score)), int(within.max(initial=0)))
    return np.asarray(vectors @ (shrink[best] * projected))


@functools.lru_cache(maxsize=16)
def _penalty(size: int) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of D'D for the second-difference matrix D of `size` values."""
    difference = np.diff(np.eye(size), n=2, axis=0)
    values, vectors = np.linalg.eigh(difference.T @ difference)
    return np.maximum(values, 0.0), vectors
