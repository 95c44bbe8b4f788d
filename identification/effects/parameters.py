"""Parameters that many effects have, with their usual priors, and matrices of starting values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.parameter import Parameter
from identification.model.term import Expression

__all__ = ["THERMAL_S", "amplitude", "asymmetry", "columns", "one_sign", "shape", "uneven"]

_REVERSES: Final = 0.1
"""Ratio of the peaks of the two signs above which a signal has both."""

THERMAL_S: Final = 3600.0
"""Longest thermal time constant of a small motor [s].  A record that is shorter shows the rate of
such a change and so bounds its size only together with the time constant, which therefore may not
be limited by the length of the record.

Data sheets state the time constant of the winding and the longer one of the housing (maxon,
Explanation of the DC motors).  That of servo motors of 0.9 to 9 kW is 12 to 33 min (WITTENSTEIN
alpha, premo SP series, manual 4022-D045530, table 16); an hour is twice the largest."""


def amplitude(
    name: str, unit: str, meaning: str, size: float, *, signed: bool = False
) -> Parameter:
    """Parameter to which the effect is proportional.

    `size` is the scale of the quantity that the effect changes; the prior's standard deviation is
    three times as large [unit].
    """
    lower = -np.inf if signed else 0.0
    return Parameter(name, unit, meaning, scale=size, lower=lower, prior_sd=3.0)


def asymmetry() -> Parameter:
    """Parameter for the difference between two directions, as in contacts or preloaded bearings."""
    meaning = "(forward - reverse) / (forward + reverse)"
    return Parameter("asymmetry", "-", meaning, scale=0.1, lower=-0.6, upper=0.6, prior_sd=2.0)


def uneven(share: Expression, asymmetry: Expression, reference: int) -> Expression:
    """Share -1 to 1 of an effect, larger in one direction, over that in the reference direction.

    The reference 0 is the mean of both directions.  Runs in one direction determine the size in
    that direction, and no asymmetry; with the mean, the posterior would be a curved ridge along
    which both have the same product.
    """
    return (share + asymmetry * ca.fabs(share)) / (1 + asymmetry * reference)


def one_sign(signals: Iterable[Array]) -> int:
    """Sign of signals (n_sample,) whose peak of the other sign is at most a tenth as high; 0 else.

    A small part of the other sign is noise, or an oscillation about standstill.
    """
    ends = [(float(np.min(signal)), float(np.max(signal))) for signal in signals]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    if min(high, -low) > _REVERSES * max(high, -low):
        return 0
    return 1 if high > -low else -1


def shape(name: str, unit: str, meaning: str, lower: float, upper: float) -> Parameter:
    """Positive shape parameter, searched in its logarithm.

    The bounds [unit] are the smallest and the largest value that is distinguishable from a limit
    case.

    The prior is normal in the logarithm and broad: its standard deviation is twice that of a
    uniform distribution between the bounds.
    """
    middle = float(np.sqrt(lower * upper))
    width = float(np.log(upper / lower) / np.sqrt(12.0))
    return Parameter(
        name, unit, meaning, search="log", lower=lower, upper=upper,
        prior_mean=middle, prior_sd=2.0 * width,
    )  # fmt: skip


def columns(*starts: Sequence[float]) -> Array:
    """(n_parameter, n_start) matrix of starting vectors."""
    return np.array(starts, dtype=np.float64).T
