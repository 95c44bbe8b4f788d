"""Pareto-smoothed importance sampling, for a chain that did not converge.

Points are drawn from a wide multivariate t around the optimum and weighted by posterior over
proposal density.  The largest weights are smoothed by a generalised Pareto distribution.  Its shape
k shows whether the weighted draws represent the posterior: the variance of the weights is finite
below 1/2, and estimates are reliable up to about 0.7 (less for few draws).

Source: Vehtari, Simpson, Gelman, Yao, Gabry, J. Machine Learning Research 25 (2024) 1-58, Pareto
smoothed importance sampling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.posterior.density import Posterior
from identification.posterior.proposal import StudentProposal

__all__ = ["Weighted", "largest_shape", "smoothed", "weighted_draws"]

_DRAWS: Final = 4096
_LEAST_DRAWS: Final = 1000
"""Largest (`_DRAWS`) and least number of weighted draws."""
_FREEDOM: Final = 5.0
_INFLATION: Final = 1.1
_BATCH: Final = 512
_PILOT: Final = 2 * _BATCH
"""Draws after which the shape is estimated for the first time."""
_PILOT_SD: Final = 3.0
"""Standard deviations by which that estimate exceeds the reliable shape if more draws are in
vain."""
_LEAST_TAIL: Final = 5


@dataclass(frozen=True)
class Weighted:
    """Points that represent the posterior."""

    points: Array
    """(n_draw, n_dim) in the sampled coordinates, equally weighted."""
    log_density: Array
    """(n_draw,) their log posterior density."""
    shape: float
    """Pareto shape k of the largest weights [-]."""
    draws: int
    """Number of weighted draws from which the points were chosen."""

    @property
    def is_reliable(self) -> bool:
        """True if the points represent the posterior."""
        return self.shape <= largest_shape(self.draws)


def largest_shape(draws: int) -> float:
    """Largest reliable Pareto shape [-] for a number of weighted draws (source, section 3.2)."""
    return float(min(1.0 - 1.0 / np.log10(draws), 0.7))


def weighted_draws(posterior: Posterior, seed: int, count: int, work: float = np.inf) -> Weighted:
    """Draws from the posterior by importance resampling.

    At least a thousand draws are made, whatever the operation budget.  No more than `_PILOT` are
    made if their shape shows that all draws would not be reliable either.
    """
    draws = int(np.clip(_BATCH * work / posterior.work(_BATCH), _LEAST_DRAWS, _DRAWS))
    proposal = StudentProposal(posterior.centre, _INFLATION * posterior.covariance(), _FREEDOM)
    random = np.random.RandomState(seed)  # noqa: NPY002
    centres = np.repeat(posterior.centre[None, :], draws, axis=0)
    points, ratios = proposal(centres, random)
    density = np.zeros(0)
    while density.size < draws:
        density = np.append(density, posterior(points[density.size : density.size + _BATCH]))
        if density.size == _PILOT and _is_hopeless(smoothed(density + ratios[:_PILOT])[1]):
            draws = _PILOT
    weights, shape = smoothed(density + ratios[:draws])
    # Systematic resampling: each point appears as often as its weight requires, within one.
    places = (np.arange(count) + random.random_sample()) / count
    chosen = np.searchsorted(np.cumsum(weights), places).clip(max=draws - 1)
    chosen = random.permutation(chosen)
    return Weighted(points[chosen], density[chosen], shape, draws)


def _is_hopeless(shape: float) -> bool:
    """True if the Pareto shape of the pilot draws excludes reliable importance weights.

    The estimate from m excesses has the standard deviation (1 + k) / sqrt(m).

    Source: Smith, Annals of Statistics 15 (1987), 1174-1207 (generalised Pareto tails).
    """
    largest = largest_shape(_DRAWS)
    return shape > largest + _PILOT_SD * (1.0 + largest) / math.sqrt(_tail(_PILOT))


def _tail(count: int) -> int:
    """Number of the largest weights that are smoothed."""
    return int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))


def smoothed(log_weights: Array) -> tuple[Array, float]:
    """Importance weights (n_draw,) from log weights, the largest smoothed by a Pareto distribution.

    The weights have the sum one.  The shape k of their tail is infinite if too few weights are
    positive, zero if the largest weights are equal.
    """
    count = log_weights.size
    finite = np.isfinite(log_weights)
    if not finite.any():
        return np.full(count, 1.0 / count), np.inf
    weights = np.where(finite, np.exp(log_weights - log_weights[finite].max()), 0.0)
    length = _tail(count)
    order = np.argsort(weights)
    tail = order[-length:]
    threshold = weights[order[-length - 1]]
    excess = weights[tail] - threshold
    if not threshold > 0.0 or np.count_nonzero(excess > 0.0) < _LEAST_TAIL:
        even = bool(threshold > 0.0)
        return weights / weights.sum(), 0.0 if even else np.inf
    shape, scale = _pareto(excess)
    share = (np.arange(length) + 0.5) / length
    if abs(shape) > 1e-8:
        expected = scale * np.expm1(-shape * np.log1p(-share)) / shape
    else:
        expected = -scale * np.log1p(-share)
    weights[tail] = np.minimum(threshold + expected, 1.0)
    return weights / weights.sum(), float(shape)


def _pareto(excess: Array) -> tuple[float, float]:
    """Shape and scale of a generalised Pareto distribution, from sorted excesses.

    The estimate is the mean of a profile likelihood over a grid.  A prior with the weight of ten
    observations draws the shape towards 1/2.

    Source: Zhang and Stephens, Technometrics 51 (2009) 316-325; for the prior, Vehtari et al.
    (2024), appendix G.
    """
    count = excess.size
    quarter = max(float(excess[int(count / 4.0 + 0.5) - 1]), 1e-300)
    size = 30 + int(np.sqrt(count))
    grid = 1.0 / excess[-1] + (1.0 - np.sqrt(size / (np.arange(1, size + 1) - 0.5))) / (3 * quarter)
    shapes = np.mean(np.log1p(-grid[:, None] * excess), axis=1)
    profile = count * (np.log(-grid / shapes) - shapes - 1.0)
    share = 1.0 / np.exp(profile[None, :] - profile[:, None]).sum(axis=1)
    place = float(np.sum(grid * share))
    shape = float(np.mean(np.log1p(-place * excess)))
    scale = -shape / place
    return (count * shape + 5.0) / (count + 10.0), scale
