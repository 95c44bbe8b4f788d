"""Independence proposals of the sampler, which do not depend on the walker's position.

Source: Tierney, Annals of Statistics 22 (1994), 1701-1728 (independence chains).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from identification.arrays import Array
from identification.linear import root
from identification.posterior.ridge import Ridge

__all__ = ["RidgeProposal", "StudentProposal"]

_FREEDOM: Final = 50.0
_INFLATION: Final = 1.05
"""Covariance of proposals across a ridge over the traced one; `_FREEDOM` is their degrees of
freedom."""
_GRID: Final = 100
"""Grid points per traced point; the density is constant between two grid points."""


class StudentProposal:
    """Draws from a multivariate t around (n_dim,) with an (n_dim, n_dim) scale matrix."""

    def __init__(self, centre: Array, covariance: Array, freedom: float) -> None:
        self._centre = centre
        self._root = root(covariance)
        self._freedom = freedom

    def __call__(self, coordinates: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Proposed points (n_walker, n_dim) and the log ratio of the proposal densities."""
        n_walker, n_dim = coordinates.shape
        normal = random.randn(n_walker, n_dim)
        size = np.sqrt(self._freedom / random.chisquare(self._freedom, size=n_walker))
        proposed = self._centre + (normal * size[:, None]) @ self._root.T
        return proposed, self._log_density(coordinates) - self._log_density(proposed)

    def _log_density(self, points: Array) -> Array:
        scaled = np.linalg.solve(self._root, (points - self._centre).T)
        return _student(np.sum(scaled**2, axis=0), points.shape[1], self._freedom)


class RidgeProposal:
    """Draws of the position along a traced ridge, with a multivariate t across it.

    The log noise deviations (n_noise,), which the ridge does not contain, are drawn around `noise`.
    """

    def __init__(self, ridge: Ridge, noise: Array, noise_sd: Array) -> None:
        self._ridge, self._noise, self._noise_sd = ridge, noise, noise_sd
        # Extrapolate the log density linearly by one step at both ends.
        abscissa, height = (
            np.concatenate([[2 * x[0] - x[1]], x, [2 * x[-1] - x[-2]]])
            for x in (ridge.abscissae, ridge.log_density)
        )
        grid = np.linspace(float(abscissa[0]), float(abscissa[-1]), _GRID * abscissa.size)
        log_density = PchipInterpolator(abscissa, height)(grid)
        density = np.exp(log_density - log_density.max())
        parts = 0.5 * (density[1:] + density[:-1]) * np.diff(grid)
        self._grid, self._share = grid, np.concatenate([[0.0], np.cumsum(parts) / parts.sum()])
        self._log_share = np.log(parts / parts.sum() / np.diff(grid))

    def __call__(self, coordinates: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Proposed points (n_walker, n_dim) and the log ratio of the proposal densities."""
        n_walker, n_dim = coordinates.shape
        ridge, split = self._ridge, self._ridge.centre.size
        abscissa = np.interp(random.rand(n_walker), self._share, self._grid)
        size = np.sqrt(_INFLATION * _FREEDOM / random.chisquare(_FREEDOM, size=n_walker))
        normal = random.randn(n_walker, n_dim - 1) * size[:, None]
        across = np.einsum("wij,wj->wi", self._roots(abscissa), normal[:, : split - 1])
        proposed = np.column_stack(
            [
                ridge.centre + abscissa[:, None] * ridge.tangent + across @ ridge.basis.T,
                self._noise + normal[:, split - 1 :] * self._noise_sd,
            ]
        )
        return proposed, self.log_density(coordinates) - self.log_density(proposed)

    def log_density(self, points: Array) -> Array:
        """Log density (n_walker,) of proposals at points (n_walker, n_dim), up to a constant."""
        ridge, split = self._ridge, self._ridge.centre.size
        abscissa = ridge.abscissa_of(points[:, :split].T)
        roots = self._roots(abscissa)
        away = points[:, :split] - ridge.centre - abscissa[:, None] * ridge.tangent
        across = np.linalg.solve(roots, (away @ ridge.basis)[:, :, None])[:, :, 0]
        noise = (points[:, split:] - self._noise) / self._noise_sd
        distance = (np.sum(across**2, axis=1) + np.sum(noise**2, axis=1)) / _INFLATION
        index = np.searchsorted(self._grid, abscissa) - 1
        inside = (index >= 0) & (index < self._log_share.size)
        on_ridge = np.where(inside, self._log_share[np.where(inside, index, 0)], -np.inf)
        volume = np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)), axis=1)
        return np.asarray(on_ridge - volume + _student(distance, points.shape[1] - 1, _FREEDOM))

    def _roots(self, abscissa: Array) -> Array:
        """(n_walker, n_parameter - 1, n_parameter - 1) Cholesky factors, interpolated."""
        points, roots = self._ridge.abscissae, self._ridge.roots
        index = np.clip(np.searchsorted(points, abscissa) - 1, 0, points.size - 2)
        share = (abscissa - points[index]) / (points[index + 1] - points[index])
        share = np.clip(share, 0.0, 1.0)[:, None, None]
        return np.asarray((1.0 - share) * roots[index] + share * roots[index + 1])


def _student(distance: Array, size: int, freedom: float) -> Array:
    """Log density of a multivariate t at squared scaled distances, up to a constant."""
    return np.asarray(-0.5 * (freedom + size) * np.log1p(distance / freedom))
