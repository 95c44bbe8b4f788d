"""Detection of samples at which the motor has another voltage than the logged one.

A linear motor under a held or sloped voltage obeys, exactly and at any interval,

    i[k+1] = a i[k] + b w[k] + c w[k+1] + d v[k] + f v[k+1] + g sign(i[k]) + h

A drive at its current limit lowers the voltage at the motor, so that the current stays at one level
while this regression, fitted to the other samples, predicts larger currents of any size.  A sensor
that saturates before its converter adds noise looks the same.  Either way the samples at the limit
say nothing of the motor.  A drive that clamps its voltage to that of the largest current at
standstill plus the back-EMF, v = R i_max + K w, applies another voltage already while the current
rises to the level, so the regression leaves out the rise as well.  The fit omits the samples at the
limit and starts again after each of them.

A motor that holds its highest current by itself, at a locked shaft or a constant load, agrees with
the regression, and an effect at high currents gives all samples of the level one residual.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, stretches
from identification.checks.balance import Signals, predicted, signals_of
from identification.checks.finding import Omission, omission
from identification.differences import difference_noise
from identification.ingest.run import Run

__all__ = ["current_limit_of", "noise_of", "without"]

_STAY: Final = 5
"""Fewest samples at one level: noise alone keeps a current that changes there for two or three."""
_NEAR: Final = 4.0
"""Noise deviations within which a sample is at the level."""
_HIGH: Final = 0.8
"""Least level over the highest current of its direction."""
_FEWEST: Final = 20
"""Fewest samples at the level, and half the fewest rows between limits that make a record."""
_DEVIATIONS: Final = 10.0
"""Predicted excess over the level, and its range, from which the level is a limit [deviations of
the regression]."""
_RESOLUTION: Final = 1e-4
"""Least deviation of the regression over the largest current."""
_REGRESSED: Final = 100
"""Fewest samples of the regression."""


def current_limit_of(run: Run) -> Omission | None:
    """Samples of a run at which the drive limits the current; None if there are none."""
    signals = signals_of(run, samples=run.rows)
    current = signals.current
    noise = noise_of(current)
    if not noise > 0.0:
        return None
    levels = [_level(sign * current, noise) for sign in (1.0, -1.0)]
    # Beyond the level the drive reduces the current; there, too, the voltage is not the logged one.
    at = [
        sign * current >= level - _NEAR * noise
        for sign, level in zip((1.0, -1.0), levels, strict=True)
    ]
    rises = [
        _with_rise(sign * current, near, noise) for sign, near in zip((1.0, -1.0), at, strict=True)
    ]
    limits = rises[0] | rises[1]
    used = signals.joined & ~(limits[1:] | limits[:-1])
    if np.count_nonzero(used) < _REGRESSED:
        return None
    missing, deviation = _missing(signals, used)
    limited = np.zeros(run.rows, dtype=bool)
    found: list[tuple[float, float]] = []
    for sign, near, rise, level in zip((1.0, -1.0), at, rises, levels, strict=True):
        held = near[1:] & near[:-1] & signals.joined
        over = sign * missing / deviation
        if np.count_nonzero(held) < _FEWEST:
            continue
        low, middle, high = np.quantile(over[held], [0.25, 0.5, 0.75])
        if middle > _DEVIATIONS and high - low > _DEVIATIONS:
            found.append((level, float(middle)))
            limited[1:] |= held | rise[1:] & (over > _DEVIATIONS)
    if not found:
        return None
    # The voltage of the interval in which the drive reaches or leaves its limit is not logged.
    limited[:-1] |= limited[1:].copy()
    level, excess = (max(each) for each in zip(*found, strict=True))
    return omission(
        run,
        limited,
        "current_limit",
        "current_A",
        f"stays at {level:.4g} A although the logged voltage would raise it: the drive "
        "limits the current, and the voltage is its set point, or the current sensor saturates",
        ("predicted excess of the current in standard deviations", excess, _DEVIATIONS),
        remedy="log the voltage at the motor terminals, or stay below the limit",
    )


def without(run: Run, omitted: Bool) -> Run:
    """The run with a segment for each of the stretches between the omitted samples (n_sample,)."""
    segments: list[tuple[int, int]] = []
    for start, stop in run.segments:
        pairs = (stretches(~omitted[start:stop]) + start).tolist()
        segments += [(first, last) for first, last in pairs if last - first >= _FEWEST // 2]
    return dataclasses.replace(run, segments=tuple(segments)) if segments else run


def noise_of(signal: Array) -> float:
    """Standard deviation of the noise, from second differences, or of the rounding."""
    steps = np.abs(np.diff(signal))
    step = float(np.min(steps, where=steps > 0.0, initial=np.inf))
    return max(difference_noise([signal], 2), step / np.sqrt(12.0)) if np.isfinite(step) else 0.0


def _with_rise(signal: Array, near: Bool, noise: float) -> Bool:
    """Samples at the level, and those before them at which the signal rises towards it."""
    rise = near.copy()
    rising = np.flatnonzero(np.diff(signal) > noise)[::-1]
    for k in rising.tolist():
        rise[k] |= rise[k + 1]
    return rise


def _level(signal: Array, noise: float) -> float:
    """Highest level at which a signal stays; infinite if there is none [A]."""
    windows = np.lib.stride_tricks.sliding_window_view(signal, _STAY)
    stays = np.ptp(windows, axis=1) <= 2.0 * _NEAR * noise
    middle = np.median(windows, axis=1)
    high = stays & (middle > _HIGH * np.max(signal)) & (middle > 0.0)
    if not high.any():
        return np.inf
    top = float(np.quantile(middle[high], 0.9, method="higher"))
    return float(np.median(middle[high & (np.abs(middle - top) <= _NEAR * noise)]))


def _missing(signals: Signals, used: Bool) -> tuple[Array, Array]:
    """(n_sample - 1,) predicted minus measured current, and its standard deviation [A]."""
    v, i, w = signals.voltage, signals.current, signals.speed
    largest = float(np.abs(i).max())
    sign = np.clip(i / (0.02 * largest), -1.0, 1.0)
    columns = (i[:-1], w[:-1], w[1:], v[:-1], v[1:], sign[:-1], np.ones(i.size - 1))
    current, deviation = predicted(columns, i[1:], used, _RESOLUTION * largest)
    return current - i[1:], deviation
