"""Model-free upper bound on the sensor noise, by regression on past inputs and outputs.

If the model explains little, its residual is as large as the signal, and a whitening filter
mistakes that residual for autocorrelated noise.  Whatever the voltage and the other channel of the
same run explain, with coefficients of any size and sign, is not noise: i is v - K w through a
low-pass filter, and w is v - R i with a derivative.  The noise is therefore at most the residual of
a free regression on means of both signals over past spans.

The variance of white noise, estimated from high-order differences, is added to that bound.  Under
speed feedback the voltage follows the sensor, so the regression explains part of the white noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.model.excitation import Record

__all__ = ["bounded_noise", "noise_ceiling"]

Array = NDArray[np.float64]

_MARGIN: Final = 1.5
_ROWS: Final = 50_000
_SPANS: Final = ((0, 1), (1, 2), (2, 4), (4, 8), (8, 16), (16, 32), (32, 64))
"""Bounds of the past spans over which the regressors are averaged [samples]."""
_FEWEST: Final = 20
"""Least number of samples per coefficient."""
_ORDER: Final = 4
_NORMAL: Final = 0.6745
_EXPLAINED: Final = 0.3
"""Simulation error over the standard deviation of the channel, above which the bound is applied."""


def bounded_noise(records: Sequence[Record], noise: Array, error: Array) -> Array:
    """(2,) noise of current and speed, limited to `noise_ceiling` where the model explains little.

    Args:
        records: Training records.
        noise: (2,) estimate from the residuals [A, rad/s].
        error: (2,) RMS error of the simulation [A, rad/s].
    """
    measured = np.concatenate([record.measured for record in records])
    poor = error > _EXPLAINED * np.std(measured, axis=0)
    if not poor.any():
        return noise
    return np.where(poor, np.minimum(noise, noise_ceiling(records)), noise)


def noise_ceiling(records: Sequence[Record]) -> Array:
    """(2,) largest possible noise of current and speed [A, rad/s]; infinite for short runs.

    Args:
        records: Training records.
    """
    squares, rows = np.zeros(2), 0
    for record in records:
        span = slice(0, _ROWS)
        voltage, measured = record.column("voltage")[span], record.measured[span]
        if voltage.size < _FEWEST * 2 * len(_SPANS):
            continue
        for channel in range(2):
            left = _left(measured[:, channel], voltage, measured[:, 1 - channel])
            squares[channel] += voltage.size * (left + _white(measured[:, channel]))
        rows += voltage.size
    return _MARGIN * np.sqrt(squares / rows) if rows else np.full(2, np.inf)


def _left(target: Array, *others: Array) -> float:
    """Mean square residual of the target after regression on span means of the other signals."""
    first = _SPANS[-1][1]
    columns = [np.ones(target.size - first)]
    for other in others:
        total = np.concatenate([[0.0], np.cumsum(other - other.mean())])
        at = np.arange(first, target.size)
        columns += [
            (total[at + 1 - near] - total[at + 1 - far]) / (far - near) for near, far in _SPANS
        ]
    matrix = np.column_stack(columns)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix /= np.where(scale > 0.0, scale, 1.0)
    values, *_ = np.linalg.lstsq(matrix, target[first:], rcond=1e-10)
    return float(np.mean((target[first:] - matrix @ values) ** 2))


def _white(signal: Array) -> float:
    """Variance of white noise from the median of fourth-order differences, which ignores steps."""
    gain = math.sqrt(math.comb(2 * _ORDER, _ORDER))
    return float((np.median(np.abs(np.diff(signal, n=_ORDER))) / (_NORMAL * gain)) ** 2)
