"""Which motors stand out from the fleet, by a rule that the outliers themselves do not move.

For a parameter, m is the median over the motors whose data determine it, and

    scale = 1.4826 median(|x - m|)

which for normal spread is its standard deviation, and which outliers hardly change as long as they
are fewer than half.  A motor stands out where

    |x - m| / sqrt(scale^2 + s^2) > 3.5

with its own standard deviation s, so that a motor is not called odd because it was measured badly.
3.5 is the threshold of Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993: one motor in
two thousand of a normal fleet.  Resistance, torque constant, inertia, friction and inductance are
compared as logarithms, since tolerances are parts of a value; the temperature coefficients as they
are.  With fewer than five motors nothing is called an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.fleet.refit import Refit

__all__ = ["LEAST_MOTORS", "POSITIVE", "THRESHOLD", "Spread", "spread_of"]

THRESHOLD = 3.5
"""Robust standard deviations from which on a motor stands out."""
LEAST_MOTORS = 5
"""Fewest motors among which one can stand out."""
POSITIVE = frozenset({"Ra25", "Kt25", "J", "b", "L"})
"""Parameters that are compared as logarithms."""
_NORMAL = 1.4826


@dataclass(frozen=True)
class Spread:
    """One parameter over the fleet.

    Args:
        count: Number of motors whose data determine it.
        median: Their median, in the unit of the parameter.
        relative_scale: Robust standard deviation over the median; None where the median is zero.
        scores: For each motor of the fleet its distance from the median in robust standard
            deviations, with its own included; None where it cannot be compared.
    """

    count: int
    median: float | None
    relative_scale: float | None
    scores: tuple[float | None, ...]

    def is_outlier(self, place: int) -> bool:
        """Whether the motor at a place of the fleet stands out."""
        score = self.scores[place]
        return self.count >= LEAST_MOTORS and score is not None and abs(score) > THRESHOLD


def spread_of(name: str, refits: Sequence[Refit]) -> Spread:
    """How a parameter lies over the fleet.

    Args:
        name: Name of the parameter.
        refits: The fleet.
    """
    known = [one.usable if (one := refit.estimates.get(name)) else None for refit in refits]
    medians = [pair[0] for pair in known if pair is not None]
    if not medians:
        return Spread(0, None, None, (None,) * len(refits))
    is_logarithmic = name in POSITIVE and min(medians) > 0.0
    pairs = [_logarithm(pair) if pair and is_logarithmic else pair for pair in known]
    values = np.array([pair[0] for pair in pairs if pair is not None])
    centre = float(np.median(values))
    scale = _NORMAL * float(np.median(np.abs(values - centre)))
    median = float(np.median(medians))
    if is_logarithmic:
        relative: float | None = math.expm1(scale)
    else:
        relative = scale / abs(median) if median else None
    scores = tuple(None if pair is None else _score(pair, centre, scale) for pair in pairs)
    return Spread(len(medians), median, relative, scores)


def _logarithm(pair: tuple[float, float]) -> tuple[float, float]:
    """Logarithm of a value, and its standard deviation to first order."""
    value, sd = pair
    return math.log(value), sd / value


def _score(pair: tuple[float, float], centre: float, scale: float) -> float | None:
    value, own = pair
    spread = math.hypot(scale, own)
    return (value - centre) / spread if spread > 0.0 else None
