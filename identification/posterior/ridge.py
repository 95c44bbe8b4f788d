"""The ridge of a posterior that is long in one direction and bent, or ends there.

Where runs determine products of parameters far better than the parameters themselves (a motor
whose back-EMF is weak beside its friction, say), the posterior is a thin, curved ridge, and a
sampler that proposes straight steps crawls along it.  So the ridge is traced by optimising all
other directions while one runs (`trace`), and the posterior is sampled in coordinates sheared
along it,

    z = w + s(t(w)),      t(w) = l . (w - z_0),      l . s = 0,

which leave volumes unchanged: the density needs no correction and stays exact.  The best initial
states of the records go along with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

__all__ = ["Ridge"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ridge:
    """A shear that makes a bent ridge straight, and what the posterior is along it.

    Args:
        centre: (n_parameter,) the optimum, search coordinates.
        tangent: (n_parameter,) one posterior standard deviation along the ridge, at the optimum.
        along: (n_parameter,) the functional l that measures the way along the ridge, in standard
            deviations.
        way: (n_point,) ways at which the ridge was traced [-]; only 0 where it is straight.
        shifts: (n_point, n_parameter) the ridge's distance from its tangent.
        states: For each record (n_point, n_state) how far its best initial state is from where the
            slopes at the optimum lead.
        log_density: (n_point,) of the way, all other directions integrated out.
        roots: (n_point, n_parameter - 1, n_parameter - 1) Cholesky factors of the covariance
            across the ridge, in `basis`.
        basis: (n_parameter, n_parameter - 1) orthonormal directions that do not move along.
    """

    centre: Array
    tangent: Array
    along: Array
    way: Array
    shifts: Array
    states: tuple[Array, ...]
    log_density: Array
    roots: Array
    basis: Array

    @property
    def is_straight(self) -> bool:
        """Whether there is nothing to straighten."""
        return self.way.size < 2

    def bent(self, straight: Array) -> Array:
        """Search coordinates (n_parameter, ...) of sheared ones."""
        if self.is_straight:
            return straight
        return np.asarray(straight + self._beyond(self.shifts, self.way_of(straight)))

    def straightened(self, bent: Array) -> Array:
        """Sheared coordinates (n_parameter, ...) of search coordinates; what `bent` takes back."""
        # The shear does not move a point along the ridge, l . s = 0.
        if self.is_straight:
            return bent
        return np.asarray(bent - self._beyond(self.shifts, self.way_of(bent)))

    def state_shift(self, record: int, position: Array) -> Array:
        """What the best initial state of a record has beside its slopes, (n_state, ...).

        Args:
            record: Number of the record.
            position: (n_parameter, ...) search coordinates.
        """
        shifts = self.states[record]
        if self.is_straight:
            return np.zeros((shifts.shape[1], *position.shape[1:]))
        return self._beyond(shifts, self.way_of(position))

    def way_of(self, points: Array) -> Array:
        """The way along the ridge (...) of points (n_parameter, ...), sheared or not."""
        return np.asarray(np.tensordot(self.along, (points.T - self.centre).T, axes=1))

    def _beyond(self, values: Array, way: Array) -> Array:
        """Values (n_point, n_value) of the traced points at other ways (...), (n_value, ...)."""
        inside = np.clip(way, self.way[0], self.way[-1])
        spline = CubicSpline(self.way, values, bc_type="natural")
        found = spline(inside) + spline(inside, 1) * (way - inside)[..., None]
        return np.asarray(np.moveaxis(found, -1, 0))
