"""Linear filters along the first axis of a series.

    moving average    y[t] = c_0 x[t] + c_1 x[t-1] + ... + c_p x[t-p]
    recursive         y[t] = x[t] - c_1 y[t-1] - ... - c_p y[t-p]

The recursion is a triangular banded system of equations.  `scipy.signal.lfilter` computes the same,
but importing its package takes longer than fitting a record of a few hundred samples.

Source: Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd edition (2010), section 6.3.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dtbtrs

from identification.arrays import Array

__all__ = ["moving_average", "recursive"]


def moving_average(taps: Array, series: Array) -> Array:
    """Series (n_sample, ...) filtered with taps (p + 1,), from zeros before the first sample."""
    filtered = np.zeros_like(series)
    for lag in range(min(taps.size, len(series)) - 1, -1, -1):
        filtered[lag:] += taps[lag] * series[: len(series) - lag]
    return filtered


def recursive(taps: Array, series: Array, before: Array | None = None) -> Array:
    """Series (n_sample, ...) filtered recursively with taps (1, c_1, ..., c_p).

    `before` are the p last filtered samples before the first one, (p, ...); zeros if None.
    """
    order, count = taps.size - 1, len(series)
    if not order or not count:
        return series.copy()
    driven = series.reshape(count, -1).copy()
    if before is not None:
        known = np.concatenate([before, np.zeros_like(before)]).reshape(2 * order, -1)
        ahead = moving_average(np.concatenate([[0.0], taps[1:]]), known)[order:]
        driven[:order] -= ahead[:count]
    filtered, _ = dtbtrs(np.repeat(taps[:, None], count, axis=1), driven, uplo="L")
    return np.asarray(filtered).reshape(series.shape)
