"""Consider covariance of a residual that is larger where it determines certain parameters.

The intervals assume that the noise of a channel is the same at all samples; one number, the
effective sample fraction, corrects it for all parameters alike.  Samples that are taken at other
times than logged, for example, have a large error in the transients of the current, which alone
determine the inductance, and none elsewhere.  The sandwich covariance over stretches of the records
shows this for each direction of the parameters.

The ratios of the two covariances are the eigenvalues of a Wishart matrix if the noise is the same
everywhere.  Directions whose ratio exceeds the largest of such eigenvalues get the covariance of
the sandwich.

Source: Liang and Zeger, Biometrika 73 (1986), 13-22 (sandwich over clusters); Johnstone, Annals of
Statistics 29 (2001), 295-327 (largest eigenvalue of a Wishart matrix, Tracy-Widom law).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.fit.effective_samples import influences
from identification.fit.solve import Fit
from identification.linear import root, solution
from identification.selection.omitted import OmittedTerm, independent

__all__ = ["UNEVEN", "largest_by_chance", "uneven_residual"]

UNEVEN: Final = "uneven_residual"
"""Name of the terms."""

_FEWEST: Final = 2
"""Least number of stretches for each parameter."""
_LEVEL: Final = 3.2724
"""Quantile 99.9 % of the Tracy-Widom law of real matrices (Bejan, 2005, table 2)."""


def uneven_residual(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes by a residual that is larger where some parameters act.

    `fraction` is the effective sample fraction, by which the intervals are corrected already [-].
    """
    steps = influences(fit)
    n, number = steps.shape
    if number < _FEWEST * n or not np.isfinite(steps).all():
        return ()
    factor = root(fit.equations.covariance(fraction))
    directions, sizes, _ = np.linalg.svd(solution(factor, steps), full_matrices=False)
    ratios = sizes**2 * number / (number - 1)
    uneven = ratios > largest_by_chance(n, number - 1)
    excess = np.sqrt(np.maximum(ratios[uneven] - 1.0, 0.0))
    return independent(fit, fraction, UNEVEN, factor @ (directions[:, uneven] * excess))


def largest_by_chance(n: int, freedom: int) -> float:
    """Largest eigenvalue of a Wishart matrix over its degrees of freedom, exceeded at 0.1 % [-].

    The n variables are independent, each of variance 1.
    """
    edge, size = np.sqrt(freedom - 1.0) + np.sqrt(n), 1.0 / np.sqrt(freedom - 1.0) + n**-0.5
    return float((edge**2 + _LEVEL * edge * size ** (1.0 / 3.0)) / freedom)
