"""Shear that straightens a curved or truncated ridge of the posterior.

If runs determine products of parameters far better than the parameters themselves (for example, if
the back-EMF is weak compared with the friction), the posterior is a thin, curved ridge.  A sampler
with straight proposals moves slowly along it.  The ridge is therefore traced by optimising all
other directions at a sequence of positions (`ridge_tracing.py`).  The posterior is sampled in
coordinates sheared along it,

    z = w + s(t(w)),      t(w) = l . (w - z_0),      l . s = 0,

which preserve volume: the density needs no Jacobian and stays exact.  The best initial states of
the records are tabulated along the ridge as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from identification.arrays import Array

__all__ = ["Ridge"]


@dataclass(frozen=True)
class Ridge:
    """Shear that straightens a curved ridge, and the posterior along the ridge."""

    centre: Array
    """(n_parameter,) the optimum, search coordinates."""
    tangent: Array
    """(n_parameter,) one posterior standard deviation along the ridge, at the optimum."""
    functional: Array
    """(n_parameter,) linear functional l that gives the position along the ridge, in standard
    deviations."""
    abscissae: Array
    """(n_point,) traced positions along the ridge [-]; only 0 if it is straight."""
    shifts: Array
    """(n_point, n_parameter) distance of the ridge from its tangent."""
    states: tuple[Array, ...]
    """For each record (n_point, n_state) distance of its best initial state from the linear
    extrapolation at the optimum."""
    log_density: Array
    """(n_point,) along the ridge, all other directions integrated out."""
    roots: Array
    """(n_point, n_parameter - 1, n_parameter - 1) Cholesky factors of the covariance across the
    ridge, in `basis`."""
    basis: Array
    """(n_parameter, n_parameter - 1) orthonormal directions orthogonal to `functional`."""

    @property
    def is_straight(self) -> bool:
        """Whether the ridge needs no shear."""
        return self.abscissae.size < 2

    def bent(self, straight: Array) -> Array:
        """Search coordinates (n_parameter, ...) of sheared ones."""
        return straight if self.is_straight else straight + self._shift(straight)[0]

    def straightened(self, bent: Array) -> Array:
        """Sheared coordinates (n_parameter, ...) of search coordinates; the inverse of `bent`."""
        # The shear keeps the position along the ridge, since l . s = 0.
        return bent if self.is_straight else bent - self._shift(bent)[0]

    def state_shifts(self, position: Array) -> list[Array]:
        """Distance of each best initial state from its linear extrapolation, (n_state, ...).

        `position` holds search coordinates, (n_parameter, ...).
        """
        if self.is_straight:
            rest = position.shape[1:]
            return [np.zeros((own.shape[1], *rest)) for own in self.states]
        return self._shift(position)[1:]

    def abscissa_of(self, points: Array) -> Array:
        """Position along the ridge (...) of points (n_parameter, ...), sheared or not."""
        return np.asarray(np.tensordot(self.functional, (points.T - self.centre).T, axes=1))

    @cached_property
    def _spline(self) -> CubicSpline:
        """Shifts of the parameters, then of each record's states, over the position."""
        return CubicSpline(
            self.abscissae, np.hstack([self.shifts, *self.states]), bc_type="natural"
        )

    def _shift(self, points: Array) -> list[Array]:
        """Shifts of the parameters, and of each record's states, at the given points."""
        abscissa = self.abscissa_of(points)
        inside = np.clip(abscissa, self.abscissae[0], self.abscissae[-1])
        found = self._spline(inside) + self._spline(inside, 1) * (abscissa - inside)[..., None]
        ends = np.cumsum([self.shifts.shape[1], *(own.shape[1] for own in self.states)])
        return list(np.split(np.moveaxis(found, -1, 0), ends[:-1]))
