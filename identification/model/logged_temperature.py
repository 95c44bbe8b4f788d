"""Smoothing of the logged temperature: noise and quantisation removed."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.arrays import Array

__all__ = ["coarse_step", "smooth_temperature"]

Segments = Sequence[tuple[int, int]]
"""First sample of each segment without a gap, and the one after its last."""

_KNOTS: Final = 200
_EDGE: Final = 20
"""Samples on either side of a gap whose medians are compared."""
_LEAST_STEP_K: Final = 1.0
_STEP_ERRORS: Final = 6.0
_LEAST_DITHER: Final = 0.1
"""Noise over the step of a log below which rounding hides what is between two steps."""
_NEGLIGIBLE: Final = 0.1
"""Error of the averages, over that of rounding, which is neglected."""
_STIFFNESSES: Final = np.geomspace(1e-3, 1e10, 80)


def smooth_temperature(time: Array, logged: Array, segments: Segments) -> Array:
    """Logged temperature (n_sample,) without quantisation and noise [degC].

    The temperature of a motor varies over many samples, while its logger resolves a tenth of a
    degree or a whole one.  The log is averaged over short spans, the averages are smoothed by a
    Whittaker smoother with a penalty chosen by generalised cross-validation, and a cubic spline
    interpolates them.  Segments are smoothed separately if the temperature jumps across the gap
    between them.  The time is (n_sample,) [s].
    """
    quantum = _quantum(logged)
    smooth = [
        _smooth_stretch(time[start:stop], logged[start:stop], quantum)
        for start, stop in _stretches(logged, segments, quantum)
    ]
    return np.concatenate(smooth)


def _quantum(logged: Array) -> float:
    """Smallest difference between distinct logged values, zero if all are equal [K]."""
    steps = np.diff(np.unique(logged))
    return float(steps.min()) if steps.size else 0.0


def coarse_step(logged: Array) -> tuple[float, bool]:
    """Step that a logged temperature (n_sample,) leaves unknown [K], and whether it has no noise.

    The step is that of a log without noise whose averages have the same error; zero if the noise is
    large enough to remove it.
    """
    quantum = _quantum(logged)
    _, _, within = _spans(logged)
    step = np.sqrt(12.0) * _rounding(within, quantum)
    return float(step), bool(step == quantum)


def _stretches(logged: Array, segments: Segments, quantum: float) -> list[tuple[int, int]]:
    """Segments, merged where the temperature is continuous across the gap between them.

    They are extended by the samples between them that are not simulated.
    """
    starts = [0, *(start for start, _ in segments[1:]), logged.size]
    whole = list(itertools.pairwise(starts))
    joined = whole[:1]
    for start, stop in whole[1:]:
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

    Clock [s] and log [degC] are (n_sample,); `quantum` is the quantisation step of the logger [K].
    """
    edges, mean, within = _spans(logged)
    time = np.add.reduceat(clock, edges[:-1]) / np.diff(edges)
    if time.size < 8 or np.ptp(mean) == 0.0:
        return np.interp(clock, time, mean)
    hidden = _rounding(within, quantum)
    if hidden:
        hidden = float(np.hypot(hidden, np.sqrt(np.mean(within**2 / np.diff(edges)))))
    # Natural end conditions: the extrapolation by half a span at either end is nearly linear.
    spline = CubicSpline(time, _smoothed(mean, hidden), bc_type="natural")
    return np.asarray(spline(clock), dtype=np.float64)


def _spans(logged: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Edges of short spans, and the mean and the standard deviation within each."""
    edges = np.unique(np.linspace(0, logged.size, min(_KNOTS, logged.size) + 1).astype(np.int64))
    count = np.diff(edges)
    mean = np.add.reduceat(logged, edges[:-1]) / count
    squares = np.add.reduceat(logged**2, edges[:-1]) / count
    return edges, mean, np.sqrt(np.maximum(squares - mean**2, 0.0))


def _rounding(within: Array, quantum: float) -> float:
    """Standard deviation of the rounding error in the averages of a log [K].

    Noise dithers the steps of a log: if its standard deviation is x steps, that of the error is

        V(x) = sum_k exp(-(2 pi k x)^2) / (2 pi^2 k^2)                      [step^2]

    over all temperatures, and the variance within a span is x^2 + 1/12 - V(x).  With less noise
    than a tenth of the step in most spans, the error is that of rounding, and the averages have
    steps like the log itself.

    Source: Widrow, Kollar and Liu, IEEE Trans. Instrumentation and Measurement 45 (1996), 353-361.
    """
    if quantum == 0.0:
        return 0.0
    if np.median(within) < _LEAST_DITHER * quantum:
        return quantum / math.sqrt(12.0)
    noise = np.linspace(0.0, 1.0, 1001)
    order = np.arange(1, 51)[:, None]
    left = np.sum(np.exp(-((2 * np.pi * order * noise) ** 2)) / order**2, axis=0) / (2 * np.pi**2)
    measured = float(np.mean(within**2)) / quantum**2
    error = np.sqrt(np.interp(measured, noise**2 + 1 / 12 - left, left))
    return float(error) * quantum if error > _NEGLIGIBLE / np.sqrt(12.0) else 0.0


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
