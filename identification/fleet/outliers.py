"""Robust outlier detection over the fleet by median and median absolute deviation (MAD).

For one parameter, m is the median over the motors whose data identify it, and the scaled MAD is

    scale = 1.4826 median(|x - m|)

It equals the standard deviation of a normal distribution, and outliers hardly change it as long as
they are fewer than half of the motors.  A motor is an outlier if

    |x - m| / sqrt(scale^2 + s^2) > 3.5

The standard deviation s of its own estimate is included so that an imprecise estimate is not called
an outlier.  The threshold 3.5 is from Iglewicz and Hoaglin, How to Detect and Handle Outliers,
1993: one motor in two thousand of a normally distributed fleet.  Resistance, torque constant,
inertia, friction and inductance are compared as logarithms because their tolerances are relative;
the temperature coefficients are compared as they are.  A fleet of fewer than five motors has no
outliers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.fleet.refit import Refit

__all__ = [
    "LEAST_MOTORS",
    "NORMAL_MAD",
    "POSITIVE",
    "THRESHOLD",
    "Spread",
    "scores_of",
    "spread_of",
]

THRESHOLD = 3.5
"""Robust standard deviations beyond which a motor is an outlier (Iglewicz and Hoaglin, 1993)."""
LEAST_MOTORS = 5
"""Smallest number of motors for which outliers are reported."""
POSITIVE = frozenset({"Ra25", "Kt25", "J", "b", "L"})
"""Parameters compared as logarithms."""
NORMAL_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


@dataclass(frozen=True)
class Spread:
    """Distribution of one parameter over the fleet."""

    count: int
    """Number of motors whose data identify it."""
    median: float | None
    """Median over these motors, in the unit of the parameter."""
    relative_scale: float | None
    """Robust standard deviation over the median [-]; None if the median is zero or unknown."""
    scores: tuple[float | None, ...]
    """For each motor of the fleet, the deviation from the median in robust standard deviations that
    include the motor's own [-]; None if not comparable."""

    def is_outlier(self, index: int) -> bool:
        """True if the motor at index `index` of the fleet is an outlier."""
        score = self.scores[index]
        return self.count >= LEAST_MOTORS and score is not None and abs(score) > THRESHOLD


def spread_of(name: str, refits: Sequence[Refit]) -> Spread:
    """Median and robust scale of a parameter over the fleet, and the score of each motor."""
    known = [one.usable if (one := refit.estimates.get(name)) else None for refit in refits]
    medians = [pair[0] for pair in known if pair is not None]
    if not medians:
        return Spread(0, None, None, (None,) * len(refits))
    is_logarithmic = name in POSITIVE and min(medians) > 0.0
    if is_logarithmic:
        # The standard deviation of a logarithm to first order.
        known = [pair and (math.log(pair[0]), pair[1] / pair[0]) for pair in known]
    scores, scale = scores_of(known)
    median = float(np.median(medians))
    relative = scale / abs(median) if median else None
    return Spread(len(medians), median, math.expm1(scale) if is_logarithmic else relative, scores)


def scores_of(
    pairs: Sequence[tuple[float, float] | None],
) -> tuple[tuple[float | None, ...], float]:
    """Deviation of each value from the median in robust standard deviations, and the scaled MAD.

    The pairs are values and standard deviations, at least one of them not None.
    """
    values = np.array([pair[0] for pair in pairs if pair is not None])
    centre = float(np.median(values))
    scale = NORMAL_MAD * float(np.median(np.abs(values - centre)))
    return tuple(None if pair is None else _score(pair, centre, scale) for pair in pairs), scale


def _score(pair: tuple[float, float], centre: float, scale: float) -> float | None:
    value, own = pair
    spread = math.hypot(scale, own)
    return (value - centre) / spread if spread > 0.0 else None
