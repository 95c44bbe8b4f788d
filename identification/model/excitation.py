"""From runs to records: what drives a simulation, and what it is compared with.

A *record* is one segment of one run without gaps.  Its inputs are known functions of time and go
into the simulation; its outputs are what the simulation has to explain.
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
"""Times the edges that a record has to be long to do without them."""
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
        run: Number of the run in the order of recording.
        name: File name of the run.
        start: First sample of the segment in its run.
        time: (n_sample,) time in the run [s].
        inputs: (n_sample, n_input) in the order of `INPUTS`; the last interval has zero length.
        measured: (n_sample, 2) logged current and speed [A, rad/s].
        weight: (n_sample, 2) one where the sample counts, zero where the sensor was clipped.
        angle_logged: Whether the angle is logged, and not the integral of the logged speed.
        expected: Temperature about which `RAMP` stands for it, where none was logged [degC].
        whole: (n_sample, 2) the weights with the edges of the record, where they were taken away.
        resolution: Step of the logged temperature where no noise dithers it, else zero [K].
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

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def interval(self) -> float:
        """Longest sample interval [s]."""
        return float(self.inputs[:, 0].max())

    @cached_property
    def head(self) -> Array:
        """(2,) current and speed where the record begins: the median of its first samples."""
        return np.asarray(np.median(self.measured[:3], axis=0))

    @cached_property
    def span(self) -> Array:
        """(2,) size of current and speed in the record, never zero [A, rad/s]."""
        size = np.ptp(self.measured, axis=0) + np.abs(self.measured).max(axis=0)
        return np.where(size > 0, size, 1.0)

    def column(self, name: str) -> Array:
        """One input (n_sample,)."""
        return self.inputs[:, INPUTS.index(name)]

    def within(self, edges: tuple[tuple[int, int], tuple[int, int]]) -> Record:
        """The record without samples at its edges, for which the others count the more.

        So a model that cannot know the edges compares with one that can.  A record that is not
        many times longer is kept as it is.

        Args:
            edges: For each channel the samples at the beginning and at the end.
        """
        whole = self.weight if self.whole is None else self.whole
        if not any(any(pair) for pair in edges):
            return self if self.whole is None else replace(self, weight=whole, whole=None)
        weight = whole.copy()
        for channel, (first, last) in enumerate(edges):
            if self.rows > _MANY * (first + last):
                inner = whole[first : self.rows - last, channel]
                # What counts at the edges alone counts there.
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
    """Records of runs in the order in which they were recorded.

    Args:
        runs: The runs.
        first: Number of the first run, where others were recorded before.
        hottest: Highest temperature logged in those before [degC].
        expected: Temperature of runs where none was logged, before it is known better [degC].
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
    """Share of the run that has passed, less a half, (n_sample,) [-]."""
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
        "part": np.zeros(time.size),
        "parts": np.ones(time.size),
        "temperature_rate": _rate(run, time, temperature[span]),
    }
    clipped = [run.clipped.get(name) for name in ("current_A", "speed_rad_s")]
    weight = np.column_stack(
        [np.ones(time.size) if mask is None else 1.0 - mask[span] for mask in clipped]
    )
    return Record(
        run=number,
        name=run.name,
        start=start,
        time=time,
        inputs=np.column_stack([columns[name] for name in INPUTS]),
        measured=np.column_stack([run.current[span], speed]),
        weight=weight,
        angle_logged=run.position is not None,
    )


def _rate(run: Run, time: Array, temperature: Array) -> Array:
    """Time derivative of a smooth temperature (n_sample,), zero where none was logged [K/s]."""
    if run.temperature is None:
        return np.zeros(time.size)
    return np.asarray(np.gradient(temperature, time), dtype=np.float64)


def smooth_temperature(run: Run) -> Array:
    """The logged temperature without its quantisation and noise, (n_sample,) [degC].

    A motor's temperature moves over many samples while its logger steps by a tenth or a whole
    degree; a smooth curve through the means of short spans, its stiffness chosen by
    generalised cross-validation, follows the first and not the second.  Nothing is smoothed across
    a gap at which the temperature is another one.  A run without temperature is taken to be at
    25 degC throughout.
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
    """Smallest step between values that were logged, zero where they are all alike [K]."""
    steps = np.diff(np.unique(logged))
    return float(steps.min()) if steps.size else 0.0


def _coarse_step(run: Run) -> float:
    """Step of the logged temperature where no noise dithers it, else zero [K]."""
    if run.temperature is None:
        return 0.0
    quantum = _quantum(run.temperature)
    _, _, within = _spans(run.temperature)
    return quantum if _is_hidden(within, quantum) else 0.0


def _stretches(
    logged: Array, segments: Sequence[tuple[int, int]], quantum: float
) -> list[tuple[int, int]]:
    """Segments, joined where the temperature goes on across the gap between them."""
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
    """Standard error of the median of white noise about a level, from first differences."""
    if values.size < 2:
        return 0.0
    return float(np.std(np.diff(values)) / np.sqrt(values.size))


def _smooth_stretch(clock: Array, logged: Array, quantum: float) -> Array:
    """A stretch without jumps, smoothed.

    Args:
        clock: (n_sample,) [s].
        logged: (n_sample,) [degC].
        quantum: Resolution of the logger [K].
    """
    edges, mean, within = _spans(logged)
    time = np.add.reduceat(clock, edges[:-1]) / np.diff(edges)
    if time.size < 8 or np.ptp(mean) == 0.0:
        return np.interp(clock, time, mean)
    hidden = quantum / np.sqrt(12.0) if _is_hidden(within, quantum) else 0.0
    # Natural ends: half a span beyond the first and the last mean the curve goes on straight.
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
    """Whether the quantum hides what is between its steps.

    Noise above a tenth of the quantum dithers it; below, the means step like the log itself and
    cross-validation would take the steps for signal.
    """
    return within < 0.1 * quantum


def _smoothed(series: Array, hidden: float) -> Array:
    """Whittaker's smooth of evenly spaced values.

    The stiffness is that of cross-validation, or the largest that leaves a residual no bigger
    than `hidden`, the error that the values are known to have in common with their neighbours.

    The penalty's eigenvectors diagonalise every smooth at once, so that all stiffnesses cost one
    product of matrix and vector.

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
    """Eigenvalues and eigenvectors of the squared second difference of `size` values."""
    difference = np.diff(np.eye(size), n=2, axis=0)
    values, vectors = np.linalg.eigh(difference.T @ difference)
    return np.maximum(values, 0.0), vectors
