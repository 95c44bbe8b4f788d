"""Detection of a speed from the period between the pulses of a tachometer.

A shaft with one or a few magnets, or slots, gives a pulse each time it has turned by an angle A.
The logger shows y = A / (period) from one pulse to the next.  Such a value is the mean speed over a
period that ended at the last pulse, which the logger notices up to a sample interval h later.  Its
time is therefore, on average,

    t - (A / |y| + h) / 2.

A logger that starts at rest shows zero until then.  A longer standstill is not measured: the value
remains, or becomes zero.

The intervals between changes of the value then are the periods A / |y|, within h, or multiples of
them where the speed does not change.  If values and intervals were independent, an interval would
agree with as large a probability as with the value of another update, and a Chernoff bound gives
the probability that as many agree.  A coarse or periodically held speed has other intervals.

Source: Petrella, Tursini, Peretti and Zigliotto, Proc. ACEMP (2007), 780-787 (speed from periods);
Hoeffding, J. American Statistical Association 58 (1963), 13-30, theorem 1 (Chernoff bound).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array, Bool

__all__ = ["Pulses", "find_pulses", "improbability"]

_LEVEL: Final = 1e-4
"""Probability that a speed which is not from pulses counts as such."""
_LONG: Final = 2.5
"""Interval between changes that tells of a period, and period that tells of an interval, at least
[samples]."""
_REGULAR: Final = 0.9
"""Least fraction of the intervals that agree; the others are of pulses that were missed."""
_QUANTILES: Final = (0.02, 0.1, 0.25, 0.5)
"""Quantiles of the angles between changes among which that of a pulse is; others are multiples."""
_FROM_REST: Final = 2.6
"""Least time until the first speed of a shaft that starts at rest, over the period between the
pulses: 2 at constant speed, 2 + sqrt(2) at constant acceleration."""
_SHIFTS: Final = 50
"""Pairs of an interval and the value of another update that are compared, per interval."""


@dataclass(frozen=True)
class Pulses:
    """Speed from the periods between pulses."""

    angle: float
    """Angle between pulses [rad]."""
    times: Array
    """(n_update,) middle of each period, strictly increasing [s]."""
    speeds: Array
    """(n_update,) mean over each period [rad/s]."""

    def measured(self, time: Array) -> Bool:
        """(n_sample,) True at the samples that are nearest to the middle of a period."""
        middles = (time[1:] + time[:-1]) / 2
        nearest = np.zeros(time.size, dtype=bool)
        nearest[np.searchsorted(middles, self.times)] = True
        return nearest


# The angle of a speed below the normal numbers is zero; intervals never agree with it.
@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def find_pulses(time: Array, speed: Array) -> Pulses | None:
    """Find the pulses of a tachometer in a logged speed, (n_sample,) [s] and [rad/s].

    Returns None if the speed is not held from pulse to pulse, within a small probability of error.
    """
    interval = float(np.median(np.diff(time)))
    changes = 1 + np.flatnonzero(np.diff(speed))
    gaps, values = np.diff(time[changes]), np.abs(speed[changes[1:]])
    gaps, values = gaps[values > 0.0], values[values > 0.0]
    is_long = gaps > _LONG * interval
    if not is_long.any():
        return None
    angles = [
        _refined(float(angle), gaps[is_long], values[is_long], interval)
        for angle in np.quantile((gaps * values)[is_long], _QUANTILES)
    ]
    improbable, angle = max(
        (_improbability(gaps, values, angle, interval), angle) for angle in angles
    )
    if improbable < -math.log(_LEVEL / len(_QUANTILES)):
        return None
    updates = changes[speed[changes] != 0.0]
    periods = angle / np.abs(speed[updates])
    times, speeds = time[updates] - (periods + interval) / 2, speed[updates]
    if speed[0] == 0.0 and time[updates[0]] - time[0] > _FROM_REST * periods[0] + 2 * interval:
        times, speeds = np.append(time[0], times), np.append(0.0, speeds)
    rising = times > np.maximum.accumulate(np.append(time[0] - interval, times[:-1]))
    return Pulses(angle, times[rising], speeds[rising])


def _refined(angle: float, gaps: Array, values: Array, interval: float) -> float:
    """Median angle [rad] of the intervals that are near one period or several."""
    agree = _agree(gaps, values, angle, interval)
    number = np.maximum(np.round(gaps * values / angle), 1.0)
    return float(np.median((gaps * values / number)[agree])) if agree.any() else angle


def _improbability(gaps: Array, values: Array, angle: float, interval: float) -> float:
    """Least negative log probability that as many intervals agree with their values by chance.

    Updates with a shorter period than a few samples do not count, since any interval is near a
    multiple of it.
    """
    slow = angle / values > _LONG * interval
    gaps, values = gaps[slow], values[slow]
    if gaps.size < 2:
        return 0.0
    share = float(_agree(gaps, values, angle, interval).mean())
    if share < _REGULAR:
        return 0.0
    shifts = np.unique(np.linspace(1, gaps.size - 1, _SHIFTS).astype(int))
    others = sum(_agree(gaps, np.roll(values, k), angle, interval).sum() for k in shifts)
    # Laplace's rule of succession: of few pairs, none may agree although some could.
    chance = float((others + 1) / (gaps.size * shifts.size + 2))
    return improbability(share, gaps.size, chance)


def improbability(share: float, count: int, chance: float) -> float:
    """Least negative log probability that at least a share of `count` cases occurs by chance.

    Each case occurs with the probability `chance`; the Chernoff bound on the binomial distribution.
    """
    if share <= chance:
        return 0.0
    others = (1.0 - share) * math.log((1.0 - share) / (1.0 - chance)) if share < 1.0 else 0.0
    return count * (share * math.log(share / chance) + others)


def _agree(gaps: Array, values: Array, angle: float, interval: float) -> Bool:
    """(n,) True if an interval is one period or several, within a sample interval."""
    periods = angle / values
    number = np.maximum(np.round(gaps / periods), 1.0)
    # A tenth of a sample more, since the angle is known from rounded intervals.
    return np.asarray(np.abs(gaps - number * periods) <= 1.1 * interval)
