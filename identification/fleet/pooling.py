"""Partial pooling of temperature coefficients and effect sizes over the motors of one type.

Motors of one type are similar, so each one informs about the others: an imprecise estimate is
shrunk towards the mean of its type, a precise one hardly, and a motor whose runs do not determine
the coefficient obtains the distribution of its type.  Effect sizes are pooled as logarithms if all
are positive.  The estimate of the motor itself is not changed.

A foreign motor would widen the spread of the type and shift its mean.  Outliers by the rule of
`identification.fleet.outliers`, applied within the type, are therefore left out and reported.

The model is a hierarchical normal one, with the spread between the motors integrated out:

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

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.fleet.outliers import LEAST_MOTORS, THRESHOLD, scores_of
from identification.fleet.refit import Estimate, Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["LEAST_POOLED", "POOLED_PARAMETERS", "Pool", "Population", "pools_of", "population_of"]

Quantiles = tuple[float, float, float]

POOLED_PARAMETERS: Mapping[str, float] = {"alpha_Ra": 1e-3, "alpha_Kt": 5e-4}
"""Pooled nominal parameters, each with the prior scale of its spread within a type [1/K]: a quarter
of the coefficient of copper, and half of that of NdFeB magnets."""
LEAST_POOLED = 3
"""Smallest number of motors of a type whose runs determine the quantity."""

_RELATIVE_SCALE = 0.3
_LEVELS = (0.05, 0.5, 0.95)
_GRID = 240
_DEGREES = 4.0
_LEAST_WEIGHT = 1e-7
_BISECTIONS = 50


@dataclass(frozen=True)
class Pool:
    """Distribution of one quantity over the motors of one type."""

    type: str
    name: str
    """Parameter, or effect and parameter such as ``brush_drop.voltage``."""
    unit: str
    is_relative: bool
    """True if the spread is that of the logarithm [-], not in the unit."""
    count: int
    """Number of motors whose estimates are pooled."""
    left_out: tuple[int, ...]
    """Outlying motors, which are not pooled, as indices of the fleet."""
    mean: Quantiles
    """Quantiles 5, 50 and 95 % of the mean of the type; of the geometric mean if `is_relative`."""
    spread: Quantiles
    """The same of the standard deviation between the motors of the type."""
    own: Mapping[int, Estimate]
    """The estimate of each motor itself, by index of the fleet."""
    motors: Mapping[int, Quantiles]
    """Pooled quantiles by index of the fleet; without the outlying motors."""


@dataclass(frozen=True)
class Population:
    """Posterior of a population of groups."""

    mean: Array
    """(3,) quantiles 5, 50 and 95 % of the population mean mu."""
    spread: Array
    """(3,) the same of the population standard deviation tau."""
    groups: Array
    """(n_group, 3) the same of theta_k."""


def pools_of(refits: Sequence[Refit]) -> list[Pool]:
    """Pooled quantities of all types that have enough motors."""
    pools = []
    for kind in dict.fromkeys(refit.type for refit in refits):
        motors = {n: r for n, r in enumerate(refits) if r.type == kind and r.estimates}
        for name, scale in POOLED_PARAMETERS.items():
            found = {n: r.estimates[name] for n, r in motors.items() if name in r.estimates}
            unit = DECLARED_PARAMETERS[name].unit
            pools.append(_pool(kind, name, unit, found, scale))
        sizes = dict.fromkeys(
            (name, size.unit, size.meaning)
            for refit in motors.values()
            for name, size in refit.sizes.items()
        )
        for name, unit, meaning in sizes:
            found = {
                n: r.sizes[name].estimate
                for n, r in motors.items()
                if name in r.sizes and r.sizes[name].meaning == meaning
            }
            pools.append(_pool(kind, name, unit, found, None))
    return [pool for pool in pools if pool is not None]


def population_of(values: Array, sds: Array, scale: float) -> Population:
    """Posterior of a population from estimates (n_group,) of its groups.

    At least two standard deviations (n_group,) are finite, and all are positive; an estimate with
    an infinite one is ignored. `scale` is that of the half-t prior of tau, in the unit of the
    values.
    """
    has_estimate = np.isfinite(sds)
    y, s = values[has_estimate], sds[has_estimate]
    # Below the first value, the likelihood no longer depends on tau.
    least = 0.02 * min(float(s.min()), scale)
    tau = np.geomspace(least, 30.0 * max(scale, float(np.ptp(y))), _GRID)
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


def _pool(
    kind: str, name: str, unit: str, own: Mapping[int, Estimate], scale: float | None
) -> Pool | None:
    """Pool one quantity of one type of motor; None if too few motors determine it.

    The prior scale of the spread is in `unit`; None for an effect size, whose spread is relative to
    its magnitude.
    """
    usable = {n: one for n, one in own.items() if one.usable and one.usable[1] > 0.0}
    if len(usable) < LEAST_POOLED:
        return None
    is_relative = scale is None and all((one.q05 or 0.0) > 0.0 for one in usable.values())
    pairs = {
        number: (one.logarithm if is_relative else one.usable) if number in usable else None
        for number, one in own.items()
    }
    known = np.array([pair[0] for pair in pairs.values() if pair])
    scores = dict(zip(own, scores_of(list(pairs.values()))[0], strict=True))
    left_out = [
        number
        for number, score in scores.items()
        if len(known) >= LEAST_MOTORS and score is not None and abs(score) > THRESHOLD
    ]
    pooled = [number for number in own if number not in left_out]
    count = sum(pairs[number] is not None for number in pooled)
    if count < LEAST_POOLED:
        return None
    if scale is None:
        scale = _RELATIVE_SCALE * (1.0 if is_relative else float(np.median(np.abs(known))))
    values, sds = np.array([pairs[number] or (0.0, math.inf) for number in pooled]).T
    found = population_of(values, sds, scale or _RELATIVE_SCALE)
    return Pool(
        type=kind,
        name=name,
        unit=unit,
        is_relative=is_relative,
        count=count,
        left_out=tuple(left_out),
        mean=_quantiles(found.mean, is_relative),
        spread=_quantiles(found.spread, False),
        own=own,
        motors={
            number: _quantiles(quantiles, is_relative)
            for number, quantiles in zip(pooled, found.groups, strict=True)
        },
    )


def _quantiles(values: Array, is_logarithmic: bool) -> Quantiles:
    low, median, high = (float(v) for v in (np.exp(values) if is_logarithmic else values))
    return low, median, high


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
