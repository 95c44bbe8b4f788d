"""Sensor noise without a model: an upper bound, and quantisation that exceeds the noise.

If the model explains little, its residual is as large as the signal, and a whitening filter
mistakes that residual for autocorrelated noise.  Whatever the voltage and the other channel of the
same run explain, with coefficients of any size and sign, is not noise: i is v - K w through a
low-pass filter, and w is v - R i with a derivative.  The noise is therefore at most the residual of
a free regression on means of both signals over past spans.  The variance of white noise, estimated
from high-order differences, is added to that bound.  Under speed feedback the voltage follows the
sensor, so the regression explains part of the white noise.

The rounding of a quantised signal is such a noise only if it does not persist from sample to sample
(`model/quantisation.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.differences import difference_noise
from identification.ingest.run import Run
from identification.model.excitation import Record
from identification.model.quantisation import stays, step_of
from identification.warning import ResultWarning

__all__ = ["bounded_noise", "coarse_warnings", "noise_ceiling"]

_MARGIN: Final = 1.5
_ROWS: Final = 50_000
_SPANS: Final = ((0, 1), (1, 2), (2, 4), (4, 8), (8, 16), (16, 32), (32, 64))
"""Bounds of the past spans over which the regressors are averaged [samples]."""
_FEWEST: Final = 20
"""Least number of samples per coefficient."""
_ORDER: Final = 4
_EXPLAINED: Final = 0.3
"""Simulation error over the standard deviation of the channel, above which the bound is applied."""
_COARSE: Final = 2.0
"""Step over the residual, rounding included, above which the step is too coarse; the noise without
rounding is then below 0.41 of a step."""
_MOST_NAMED: Final = 5


def bounded_noise(records: Sequence[Record], noise: Array, error: Array) -> Array:
    """(2,) noise of current and speed, limited to `noise_ceiling` where the model explains little.

    The estimate from the residuals and the RMS error of the simulation are (2,) [A, rad/s].
    """
    measured = np.concatenate([record.measured for record in records])
    poor = error > _EXPLAINED * np.std(measured, axis=0)
    if not poor.any():
        return noise
    return np.where(poor, np.minimum(noise, noise_ceiling(records)), noise)


def noise_ceiling(records: Sequence[Record]) -> Array:
    """(2,) largest possible noise of current and speed [A, rad/s]; infinite for short runs."""
    squares, rows = np.zeros(2), 0
    for record in records:
        span = slice(0, _ROWS)
        voltage, measured = record.column("voltage")[span], record.measured[span]
        if voltage.size < _FEWEST * 2 * len(_SPANS):
            continue
        for channel in range(2):
            left = _left(measured[:, channel], voltage, measured[:, 1 - channel])
            white = difference_noise([measured[:, channel]], _ORDER)
            squares[channel] += voltage.size * (left + white**2)
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


def coarse_warnings(runs: Sequence[Run], noise: Array) -> tuple[ResultWarning, ...]:
    """Warnings about channels whose quantisation step is too coarse for their noise.

    The noise (2,) is the standard deviation of the residuals [A, rad/s].
    """
    warnings = []
    for channel, (name, unit) in enumerate((("current_A", "A"), ("speed_rad_s", "rad/s"))):
        steps: dict[int, float] = {}
        for number, run in enumerate(runs):
            signal = (run.current, run.speed)[channel]
            step = step_of(signal)
            if step is not None and stays(signal) and step > _COARSE * noise[channel] > 0.0:
                steps[number] = step
        if steps:
            sizes = [f"{size:.3g}" for size in (min(steps.values()), max(steps.values()))]
            message = (
                f"{_named([runs[number].name for number in steps])}, {name}: logged in steps of "
                f"{' to '.join(dict.fromkeys(sizes))} {unit}, while the residual, rounding "
                f"included, is {noise[channel]:.3g} {unit}; its rounding is no noise that averages "
                "out, so values may be off and intervals are too narrow"
            )
            fix = "log it in finer steps"
            warnings.append(ResultWarning("coarse_quantisation", "warning", message, fix))
    return tuple(warnings)


def _named(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    more = len(distinct) - _MOST_NAMED
    return ", ".join(distinct[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
