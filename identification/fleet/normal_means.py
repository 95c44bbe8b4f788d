"""Hierarchical normal model of group means, with the spread between the groups integrated out.

    y_k | theta_k ~ N(theta_k, s_k^2)       estimate of group k, its standard deviation known
    theta_k       ~ N(mu, tau^2)            groups of one population
    mu            ~ flat
    tau           ~ half-t with 4 degrees of freedom and a given scale

For given tau, mu and all theta_k are normal in closed form (Gelman et al., Bayesian Data Analysis,
3rd edition, 2013, equations 5.17, 5.20 and 5.21).  The posterior of tau is evaluated on a grid, so
every marginal posterior is a finite mixture of normal distributions.  Intervals thus include the
uncertainty of tau, which a point estimate of tau (empirical Bayes) omits.  The half-t prior is
weakly informative and proper for two or three groups (Gelman, Bayesian Analysis 1, 2006, 515-534).
A group without an estimate has s_k = infinity; its posterior is the predictive distribution of the
population.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array

__all__ = ["Population", "population_of"]

_LEVELS = (0.05, 0.5, 0.95)
_GRID = 240
_DEGREES = 4.0
_LEAST_WEIGHT = 1e-7
_BISECTIONS = 50


@dataclass(frozen=True)
class Population:
    """Posterior of a population of groups."""

    mean: Array
    """(3,) quantiles 5, 50 and 95 % of the population mean mu."""
    spread: Array
    """(3,) the same of the population standard deviation tau."""
    groups: Array
    """(n_group, 3) the same of theta_k."""


def population_of(values: Array, sds: Array, scale: float) -> Population:
    """Posterior of a population from estimates (n_group,) of its groups.

    At least two standard deviations (n_group,) are finite, and all are positive; an estimate with
    an infinite one is ignored. `scale` is that of the half-t prior of tau, in the unit of the
    values.
    """
    has_estimate = np.isfinite(sds)
    y, s = values[has_estimate], sds[has_estimate]
    tau = _grid(y, s, scale)
    precision = 1.0 / (s**2 + tau[:, None] ** 2)
    mean_variance = 1.0 / precision.sum(axis=1)
    mean = mean_variance * (precision @ y)
    logarithm = (
        0.5 * np.log(mean_variance)
        + 0.5 * np.log(precision).sum(axis=1)
        - 0.5 * (precision * (y - mean[:, None]) ** 2).sum(axis=1)
        - 0.5 * (_DEGREES + 1.0) * np.log1p((tau / scale) ** 2 / _DEGREES)
        + np.log(tau)  # the grid is uniform in log tau
    )
    weights = np.exp(logarithm - logarithm.max())
    weights /= weights.sum()
    kept = weights > _LEAST_WEIGHT
    tau, mean, mean_variance = tau[kept], mean[kept], mean_variance[kept]
    weights = weights[kept] / weights[kept].sum()
    # Fraction of each group's difference from the mean that is retained.
    retained = tau[:, None] ** 2 / (tau[:, None] ** 2 + sds**2)
    known = np.where(has_estimate, values, 0.0)
    centres = mean[:, None] + retained * (known - mean[:, None]) * has_estimate
    variances = np.where(
        has_estimate,
        retained * np.where(has_estimate, sds, 0.0) ** 2
        + (1.0 - retained) ** 2 * mean_variance[:, None],
        tau[:, None] ** 2 + mean_variance[:, None],
    )
    return Population(
        mean=_mixture_quantiles(weights, mean[:, None], np.sqrt(mean_variance)[:, None])[0],
        spread=np.interp(_LEVELS, np.cumsum(weights), tau),
        groups=_mixture_quantiles(weights, centres, np.sqrt(variances)),
    )


def _grid(values: Array, sds: Array, scale: float) -> Array:
    """(n_tau,) values of tau; below the first one, the likelihood no longer depends on tau."""
    least = 0.02 * min(float(sds.min()), scale)
    largest = 30.0 * max(scale, float(np.ptp(values)))
    return np.geomspace(least, largest, _GRID)


def _mixture_quantiles(weights: Array, centres: Array, deviations: Array) -> Array:
    """(n_group, 3) quantiles of mixtures of normal distributions, by bisection.

    The weights are (n_tau,), means and standard deviations (n_tau, n_group).
    """
    # Lazy import: loading SciPy takes longer than building the table.
    from scipy.special import ndtr, ndtri

    found = np.empty((centres.shape[1], len(_LEVELS)))
    for column, level in enumerate(_LEVELS):
        # The quantile of a mixture lies between the smallest and the largest of its components.
        quantiles = centres + ndtri(level) * deviations
        low, high = quantiles.min(axis=0), quantiles.max(axis=0)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            is_below = weights @ ndtr((middle - centres) / deviations) < level
            low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
        found[:, column] = 0.5 * (low + high)
    return found
