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
from functools import cached_property

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
        return straight if self.is_straight else straight + self._shift(straight)[0]

    def straightened(self, bent: Array) -> Array:
        """Sheared coordinates (n_parameter, ...) of search coordinates; what `bent` takes back."""
        # The shear does not move a point along the ridge, l . s = 0.
        return bent if self.is_straight else bent - self._shift(bent)[0]

    def state_shifts(self, position: Array) -> list[Array]:
        """What the best initial state of each record has beside its slopes, (n_state, ...).

        Args:
            position: (n_parameter, ...) search coordinates.
        """
        if self.is_straight:
            rest = position.shape[1:]
            return [np.zeros((own.shape[1], *rest)) for own in self.states]
        return self._shift(position)[1:]

    def way_of(self, points: Array) -> Array:
        """The way along the ridge (...) of points (n_parameter, ...), sheared or not."""
        return np.asarray(np.tensordot(self.along, (points.T - self.centre).T, axes=1))

    @cached_property
    def _spline(self) -> CubicSpline:
        """Shifts of the parameters, then those of the states of each record, over the way."""
        return CubicSpline(self.way, np.hstack([self.shifts, *self.states]), bc_type="natural")

    def _shift(self, points: Array) -> list[Array]:
        """Shifts of the parameters, and of the states of each record, where the points are."""
        way = self.way_of(points)
        inside = np.clip(way, self.way[0], self.way[-1])
        found = self._spline(inside) + self._spline(inside, 1) * (way - inside)[..., None]
        ends = np.cumsum([self.shifts.shape[1], *(own.shape[1] for own in self.states)])
        return list(np.split(np.moveaxis(found, -1, 0), ends[:-1]))
