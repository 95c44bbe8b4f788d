"""Detection of a motor that its voltage does not reach: an open lead, or a drive that has tripped.

A linear motor under a held or sloped voltage obeys, exactly and at any interval,

    i[k+1] = a i[k] + b w[k] + c w[k+1] + d v[k] + f v[k+1] + g sign(i[k]) + h

With open terminals no current flows, while this regression, fitted to the other samples, predicts
one.  Brushes that take the voltage predict none, as the sign is that of the missing current.  A
running motor without load also has hardly any current, because v - K w is small; K changes by less
than a fifth of it, as a magnet loses at most 0.2 %/K.  The voltage at open terminals is the induced
one, so the fit omits these samples and starts again after them.

Where the log has no voltage, `checks.coasting` finds the same.  A fault of a sensor that explains
the whole run comes first.

The coefficient is that of ferrite, see `model.declared`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, stretches
from identification.checks.balance import NO_VOLTAGE, Signals, predicted, signals_of
from identification.checks.dead import stuck_findings, unlogged_voltage_findings
from identification.checks.discontinuous import discontinuous_findings
from identification.checks.finding import Omission, omission
from identification.checks.limited import noise_of
from identification.checks.signs import magnitude_findings
from identification.checks.supply import supply_current_findings
from identification.ingest.run import Run

__all__ = ["disconnections_of"]

_EXPLANATIONS: Final = (
    discontinuous_findings,
    magnitude_findings,
    stuck_findings,
    supply_current_findings,
    unlogged_voltage_findings,
)
"""Checks of the whole run whose fault also looks like a lost current."""

_FEWEST: Final = 20
"""Fewest samples without current in a row."""
_NEAR: Final = 4.0
"""Noise deviations within which a current is constant."""
_SMALL: Final = 0.05
"""Largest zero error of the current sensor, over the largest current."""
_DEVIATIONS: Final = 10.0
"""Least median of the predicted current without its sign's uncertainty [deviations]."""
_LOST: Final = 0.2
"""Least upper quartile of abs(v - K w) over abs(v): the largest change of K within a run."""
_REGRESSED: Final = 100
"""Fewest samples of the regression."""
_TRIMMED: Final = 0.01
"""Fraction of the residuals, the largest, that does not count in the regression."""
_RESOLUTION: Final = 1e-4
"""Least deviation of the regression over the largest current."""


def disconnections_of(runs: Sequence[Run]) -> list[Omission | None]:
    """Samples of each run at which the motor has no voltage but the log has; None without any."""
    return [_disconnection_of(run) for run in runs]


def _disconnection_of(run: Run) -> Omission | None:
    signals = signals_of(run, samples=run.rows)
    noise = noise_of(signals.current)
    if not noise > 0.0:
        return None
    idle = _without_current(signals.current, noise)
    driven = np.abs(signals.voltage) > NO_VOLTAGE * float(np.abs(signals.voltage).max())
    used = signals.joined & ~(idle[1:] & idle[:-1])
    if not (idle & driven).any() or np.count_nonzero(used) < _REGRESSED:
        return None
    missing, lost = _missing(signals, used, idle)
    omitted = np.zeros(run.rows, dtype=bool)
    largest = 0.0
    # A lead that is open stays so while the set point passes zero.
    for start, stop in stretches(idle).tolist():
        here = slice(start, stop - 1)
        judged = signals.joined[here] & driven[here]
        if np.count_nonzero(judged) < _FEWEST - 1:
            continue
        excess = float(np.median(missing[here][judged]))
        if excess > _DEVIATIONS and np.quantile(lost[here][judged], 0.75) > _LOST:
            omitted[_first(signals.current, start, noise) : stop] = True
            largest = max(largest, excess)
    whole = signals_of(run)
    if not largest or any(any(check(run, whole)) for check in _EXPLANATIONS):
        return None
    return omission(
        run,
        omitted,
        "disconnected",
        "current_A",
        "is zero although the logged voltage would drive a current: a lead was open, the drive had "
        "tripped or was off while its set point was logged, or a sensor failed",
        ("predicted current in standard deviations", largest, _DEVIATIONS),
        remedy="log the voltage at the motor terminals, or cut the run there",
    )


def _without_current(current: Array, noise: float) -> Bool:
    """(n_sample,) True in windows in which the current is constant and small."""
    marked = np.zeros(current.size, dtype=bool)
    if current.size < _FEWEST:
        return marked
    windows = np.lib.stride_tricks.sliding_window_view(current, _FEWEST)
    is_constant = np.ptp(windows, axis=1) <= 2.0 * _NEAR * noise
    is_small = np.abs(np.median(windows, axis=1)) <= _SMALL * float(np.abs(current).max())
    for start, stop in stretches(is_constant & is_small).tolist():
        marked[start : stop + _FEWEST - 1] = True
    return marked


def _missing(signals: Signals, used: Bool, idle: Bool) -> tuple[Array, Array]:
    """Predicted current without the measured one, and the share of the voltage that makes it.

    Both are (n_sample - 1,), the first in standard deviations of the prediction.
    """
    v, i, w = signals.voltage, signals.current, signals.speed
    largest = float(np.abs(i).max())
    least = _RESOLUTION * largest
    sign = np.clip(i / (0.02 * largest), -1.0, 1.0)[:-1]

    def columns(speed: Array, sign: Array) -> tuple[Array, ...]:
        return i[:-1], speed[:-1], speed[1:], v[:-1], v[1:], sign, np.ones(i.size - 1)

    first = np.abs(i[1:] - predicted(columns(w, sign), i[1:], used, least)[0])
    used = used & (first <= np.quantile(first[used], 1.0 - _TRIMMED))
    # The rows that are used stay as they are, so that the coefficients do, too.
    both = idle[1:] & idle[:-1]
    drawn = predicted(columns(w, np.where(both, 0.0, sign)), i[1:], used, least)[0] - i[1:]
    towards = np.where(both, np.sign(drawn), sign)
    current, deviation = predicted(columns(w, towards), i[1:], used, least)
    at_rest = predicted(columns(np.where(idle, 0.0, w), towards), i[1:], used, least)[0]
    missing = np.sign(drawn) * (current - i[1:])
    return missing / deviation, missing / np.maximum(np.abs(at_rest), least)


def _first(current: Array, start: int, noise: float) -> int:
    """Last sample with the logged voltage before the current, which ends at `start`, falls."""
    while start > 1 and abs(current[start - 1]) > abs(current[start]) + noise:
        start -= 1
    return max(start - 1, 0)
