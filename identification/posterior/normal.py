"""Draws of the normal approximation, where nobody asked for a sampled posterior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.linear import root
from identification.posterior.density import Posterior

__all__ = ["normal_draws"]

Array = NDArray[np.float64]


def normal_draws(posterior: Posterior, seed: int, count: int = 2000) -> dict[str, Array]:
    """Draws of the fit's covariance in search coordinates, mirrored at the bounds.

    Args:
        posterior: The density to approximate.
        seed: Seed of the draws.
        count: Number of draws.

    Returns:
        Physical values by name, (n_draw,) each.
    """
    rng = np.random.default_rng(seed)
    covariance = posterior.covariance()
    factor = root(covariance)
    points = posterior.centre + rng.standard_normal((count, covariance.shape[0])) @ factor.T
    values = posterior.physical(posterior.mirrored(points))
    return {name: values[:, k] for k, name in enumerate(posterior.names)}
