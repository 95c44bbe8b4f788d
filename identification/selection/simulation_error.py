"""Simulation error of a model, and its fall by an effect, under a noise model of the residuals.

The size criterion asks whether an effect changes a prediction, which is a simulation.  A whitened
error is not one: a filter that whitens slow noise also removes most of what a slow effect does.
Example: a quadratic drag that lowers the simulation error by 17 % lowers the whitened error by
1.5 % (`tests/selection/test_noise_model.py`).  Whether an effect can be noise is decided by the
likelihood, which is whitened.

Source: Ljung, System Identification, 2nd edition, section 8.5 (a noise model weighs the error of
the simulation by frequency).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.fit.solve import Fit

__all__ = ["simulation_fall", "unweighted_deviation"]


def simulation_fall(fit: Fit, simpler: Fit) -> float:
    """Fall of the logarithm of the unwhitened training error, summed over the channels [-].

    The parameters are those of the whitened fits.  Minus infinity if the noise is not whitened, or
    if one of the models diverges.
    """
    if fit.weighting.order == 0 or not (np.isfinite(fit.cost) and np.isfinite(simpler.cost)):
        return -np.inf
    fall = 0.5 * np.log(_squares(simpler) / _squares(fit))
    return float(np.sum(fall[fit.weighting.counts > 0]))


def unweighted_deviation(fit: Fit) -> Array:
    """(2,) RMS of the whitened training residuals without the weights of Student's law [A, rad/s].

    The residuals of validation runs have no such weights.  A fit without outliers gains more from
    an effect than its validation runs with theirs can confirm.
    """
    weighting = fit.weighting
    if weighting.robust is None:
        return weighting.deviation
    residuals = _residuals(fit)
    squares = replace(weighting, robust=None).sums_of_squares(residuals)
    weighted = np.maximum(weighting.sums_of_squares(residuals), np.finfo(float).tiny)
    return np.asarray(weighting.deviation * np.sqrt(squares / weighted))


def _squares(fit: Fit) -> Array:
    """(2,) sums of squares of the unwhitened residuals [A^2, rad^2/s^2]."""
    return fit.weighting.unwhitened.sums_of_squares(_residuals(fit))


def _residuals(fit: Fit) -> list[Array]:
    """For each record (n_sample, 2) measured minus simulated, without another simulation."""
    pairs = zip(fit.weighting.records, fit.equations.logged, strict=True)
    return [record.measured - logged for record, logged in pairs]
