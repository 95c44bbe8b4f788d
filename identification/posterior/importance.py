"""Weighted draws in place of a chain that did not converge.

Points are drawn from a wide multivariate t about the optimum and weighted by posterior over
proposal.  The largest weights are smoothed by a generalised Pareto law, whose shape k tells whether
the weighted draws stand for the posterior: its variance is finite below 1/2, and estimates are
reliable up to about 0.7 (less for few draws).

Source: Vehtari, Simpson, Gelman, Yao, Gabry, J. Machine Learning Research 25 (2024) 1-58, Pareto
smoothed importance sampling.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.posterior.density import Posterior
from identification.posterior.proposal import Independent

__all__ = ["Weighted", "largest_shape", "smoothed", "weighted_draws"]

Array = NDArray[np.float64]

_DRAWS: Final = 4096
_LEAST_DRAWS: Final = 1000
"""Draws that are weighted at most, and at least."""
_FREEDOM: Final = 5.0
_INFLATION: Final = 1.1
_BATCH: Final = 512
_LEAST_TAIL: Final = 5


@dataclass(frozen=True)
class Weighted:
    """Points that stand for the posterior.

    Args:
        points: (n_draw, n_dim) in the coordinates that are sampled, equally likely.
        log_density: (n_draw,) their log posterior density.
        shape: Pareto shape k of the largest weights [-].
        draws: Number of draws that were weighted.
    """

    points: Array
    log_density: Array
    shape: float
    draws: int

    @property
    def is_reliable(self) -> bool:
        """Whether the points stand for the posterior."""
        return self.shape <= largest_shape(self.draws)


def largest_shape(draws: int) -> float:
    """Pareto shape up to which so many weighted draws are reliable [-]; the source, section 3.2."""
    return float(min(1.0 - 1.0 / np.log10(draws), 0.7))


def weighted_draws(posterior: Posterior, seed: int, count: int, work: float = np.inf) -> Weighted:
    """Draws of the posterior by importance sampling.

    Args:
        posterior: The density.
        seed: Seed of the draws.
        count: Number of points to return.
        work: Operations that they may take; a thousand draws are made in any case.
    """
    draws = int(np.clip(_BATCH * work / posterior.work(_BATCH), _LEAST_DRAWS, _DRAWS))
    proposal = Independent(posterior.centre, _INFLATION * posterior.covariance(), _FREEDOM)
    random = np.random.RandomState(seed)  # noqa: NPY002
    centres = np.repeat(posterior.centre[None, :], draws, axis=0)
    points, ratios = proposal(centres, random)
    density = np.concatenate(
        [posterior(points[first : first + _BATCH]) for first in range(0, draws, _BATCH)]
    )
    weights, shape = smoothed(density + ratios)
    # Systematic: every point as often as its weight asks, give or take one.
    places = (np.arange(count) + random.random_sample()) / count
    chosen = np.searchsorted(np.cumsum(weights), places).clip(max=draws - 1)
    chosen = random.permutation(chosen)
    return Weighted(points[chosen], density[chosen], shape, draws)


def smoothed(log_weights: Array) -> tuple[Array, float]:
    """Weights whose largest are those that a Pareto law expects.

    Args:
        log_weights: (n_draw,) logarithms of the raw weights; minus infinity for none.

    Returns:
        (n_draw,) weights with sum one, and the shape k of their tail, infinite where too few
        weights are there to tell.
    """
    count = log_weights.size
    finite = np.isfinite(log_weights)
    if not finite.any():
        return np.full(count, 1.0 / count), np.inf
    weights = np.where(finite, np.exp(log_weights - log_weights[finite].max()), 0.0)
    length = int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))
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
    """Shape and scale of a generalised Pareto law, from sorted excesses over its threshold.

    The mean of a profile likelihood over a grid, drawn towards 1/2 as ten more observations would.

    Source: Zhang and Stephens, Technometrics 51 (2009) 316-325; for the pull, Vehtari et al.
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
