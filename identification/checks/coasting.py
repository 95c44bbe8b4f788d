"""Detection of bridges that are switched off while the motor turns.

Such a bridge lets the motor coast: the log has no voltage, the motor has its induced one, and the
current is zero although the speed would drive a braking current through a shorted bridge.  Over
windows of 1 and 16 samples, in which the noise of a coarse encoder averages out, the balance

    mean(i) = (mean(v) - K mean(w)) / R - T (i_end - i_begin) / length + g sign(mean(i)) + h

is fitted to the other samples and predicts that current.  T is L / R, or the time constant of a
filter of the current sensor, through which the current ends slowly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, Index
from identification.checks.balance import NO_VOLTAGE, Signals, predicted, signals_of
from identification.checks.finding import Omission, omission
from identification.checks.limited import noise_of
from identification.ingest.run import Run

__all__ = ["all_marked", "coasting_of", "coastings_of", "without_pauses"]

_NEAR: Final = 4.0
"""Noise deviations within which a signal is zero."""
_FAST: Final = 0.3
"""Least speed of the samples that prove a coasting motor, over the highest speed: the voltage that
brushes lose stops the current of a braked motor at lower speeds."""
_BRAKING: Final = 5.0
"""Least lower quartile of the predicted braking current [deviations of the regression]."""
_LENGTHS: Final = (1, 16)
"""Intervals of a window."""
_FEWEST: Final = 20
"""Fewest windows that prove a coasting motor."""
_REGRESSED: Final = 100
"""Fewest windows of the regression."""
_RESOLUTION: Final = 1e-4
"""Least deviation of the regression over the largest current."""
_ZERO: Final = 0.1
"""Largest zero error of the current sensor, over the largest current."""


def coastings_of(runs: Sequence[Run]) -> list[Omission | None]:
    """Samples of each run at which the bridge is off; None for a run without."""
    found = [coasting_of(run) for run in runs]
    if not any(found):
        return found
    pairs = zip(runs, found, strict=True)
    return [one or coasting_of(run, fastest_share=0.0) for run, one in pairs]


def coasting_of(run: Run, fastest_share: float = _FAST) -> Omission | None:
    """Samples of a run at which the bridge is off; None if there are none.

    Only samples above `fastest_share` of the highest speed prove it.
    """
    signals = signals_of(run, samples=run.rows)
    idle, undriven = _idle(signals)
    if not undriven.any():
        return None
    turning = idle & _moves(signals)
    braking = max(_braking(signals, turning, length, fastest_share) for length in _LENGTHS)
    if braking < _BRAKING:
        return None
    return omission(
        run,
        _turning_stretches(signals, idle, undriven),
        "coasting",
        "voltage_V",
        "is logged as zero while the motor turns without current: the bridge is off and the motor "
        "coasts at its induced voltage, or the current sensor does not measure a braking current",
        ("predicted braking current in standard deviations, lower quartile", braking, _BRAKING),
        remedy="log the voltage at the motor terminals, or let the bridge short the motor",
    )


def without_pauses(signals: Signals) -> Signals:
    """Signals without the intervals in which the bridge may be off."""
    idle, _ = _idle(signals)
    return replace(signals, joined=signals.joined & ~(idle[1:] | idle[:-1]))


def _idle(signals: Signals) -> tuple[Bool, Bool]:
    """(n_sample,) samples without voltage whose current is zero or ends; those without voltage."""
    volts = np.abs(signals.voltage)
    undriven = volts <= NO_VOLTAGE * float(volts.max())
    if not undriven.any():
        return undriven, undriven
    near = _NEAR * noise_of(signals.current)
    current = signals.current - _zero(signals, undriven, _moves(signals))
    return undriven & ((np.abs(current) <= near) | _falls(current, undriven, near)), undriven


def _moves(signals: Signals) -> Bool:
    """(n_sample,) True where the speed is not noise about zero."""
    return np.asarray(np.abs(signals.speed) > _NEAR * noise_of(signals.speed))


def _zero(signals: Signals, undriven: Bool, moves: Bool) -> float:
    """Zero error of the current sensor, without voltage and preferably at rest [A]."""
    rests = undriven & ~moves
    zero = float(np.median(signals.current[rests if rests.any() else undriven]))
    return zero if abs(zero) <= _ZERO * float(np.abs(signals.current).max()) else 0.0


def _falls(current: Array, undriven: Bool, near: float) -> Bool:
    """(n_sample,) True in stretches without voltage whose current only falls from its first value.

    A filter of the sensor shows the end of a current like this; that of a shorted motor reverses.
    """
    starts = _starts(undriven)
    lengths = np.diff(np.append(starts, current.size))
    first = np.repeat(current[starts], lengths)
    along = np.sign(first) * current
    falls = (np.minimum.reduceat(along, starts) >= -near) & (
        np.maximum.reduceat(along, starts) <= np.abs(current[starts]) + near
    )
    return np.repeat(falls, lengths) & undriven


def _braking(signals: Signals, idle: Bool, length: int, fastest_share: float) -> float:
    """Lower quartile of the braking current that the idle samples lack; 0 if it is unknown.

    The current is predicted over windows of `length` intervals, in deviations.
    """
    joined = all_marked(signals.joined, length)
    held = all_marked(idle, length + 1) & joined
    # The voltage is held or sloped between the samples, so the sums at both ends are regressors.
    v = _sums(signals.voltage, length)
    i, w = (
        (x[1:] + x[:-1]) / (2.0 * length)
        for x in (_sums(signals.current, length), _sums(signals.speed, length))
    )
    fast = held & (np.abs(w) > fastest_share * float(np.abs(signals.speed).max()))
    used = joined & ~_any(idle, length + 1)
    if np.count_nonzero(fast) < _FEWEST or np.count_nonzero(used) < _REGRESSED:
        return 0.0
    change = signals.current[length:] - signals.current[:-length]
    largest = float(np.abs(signals.current).max())
    sign = np.clip(i / (0.02 * largest), -1.0, 1.0)
    columns = (v[:-1], v[1:], w, change, sign, np.ones(i.size))
    current, deviation = predicted(columns, i, used, _RESOLUTION * largest)
    return float(np.quantile((-np.sign(w) * (current - i) / deviation)[fast], 0.25))


def _turning_stretches(signals: Signals, idle: Bool, undriven: Bool) -> Bool:
    """(n_sample,) stretches without voltage that have idle samples and in which the motor turns.

    A bridge that is off stays off until the next voltage, also while the sensor of the current
    settles and at low speed.  The noise of the mean speed falls with the samples of a stretch.
    """
    starts = _starts(undriven)
    lengths = np.diff(np.append(starts, idle.size))
    means = np.abs(np.add.reduceat(signals.speed, starts)) / lengths
    turns = means > _NEAR * noise_of(signals.speed) / np.sqrt(lengths)
    turns &= np.logical_or.reduceat(idle, starts)
    return np.repeat(turns, lengths) & undriven


def _starts(marked: Bool) -> Index:
    """First samples of the stretches with and without a mark."""
    return np.concatenate(([0], np.flatnonzero(np.diff(marked)) + 1))


def _sums(signal: Array, length: int) -> Array:
    """(n_sample - length + 1,) sums over windows of samples."""
    sums = np.cumsum(np.concatenate(([0.0], signal)))
    return np.asarray(sums[length:] - sums[:-length])


def _any(marked: Bool, length: int) -> Bool:
    """(n - length + 1,) True for windows in which a value is marked."""
    counts = np.cumsum(np.concatenate(([0], marked)))
    return np.asarray(counts[length:] > counts[:-length])


def all_marked(marked: Bool, length: int) -> Bool:
    """(n - length + 1,) True for windows in which all values are marked."""
    return ~_any(~marked, length)
