"""Draws from the normal (Laplace) approximation of the posterior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.linear import root
from identification.posterior.density import Posterior

__all__ = ["normal_draws", "normal_points"]

Array = NDArray[np.float64]


def normal_draws(posterior: Posterior, seed: int, count: int = 2000) -> dict[str, Array]:
    """Draws from the normal approximation in search coordinates, mirrored at the bounds.

    Args:
        posterior: The density to approximate.
        seed: Seed of the draws.
        count: Number of draws.

    Returns:
        Physical values by name, (n_draw,) each.
    """
    values = posterior.physical(normal_points(posterior, seed, count))
    return {name: values[:, k] for k, name in enumerate(posterior.names)}


def normal_points(posterior: Posterior, seed: int, count: int) -> Array:
    """The same draws in the sampled coordinates, (n_draw, n_dim).

    The arguments are those of `normal_draws`.
    """
    rng = np.random.default_rng(seed)
    covariance = posterior.covariance()
    factor = root(covariance)
    points = posterior.centre + rng.standard_normal((count, covariance.shape[0])) @ factor.T
    return posterior.mirrored(points)
