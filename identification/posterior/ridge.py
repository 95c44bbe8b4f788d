"""The ridge of a posterior that is long in one direction and bent.

Where runs determine products of parameters far better than the parameters themselves (a motor
whose back-EMF is weak beside its friction, say), the posterior is a thin, curved ridge, and a
sampler that proposes straight steps crawls along it.  So the ridge is traced by optimising all
other directions while one runs, and the posterior is sampled in coordinates sheared along it,

    z = w + s(t(w)),      t(w) = l . (w - z_0),      l . s = 0,

which leave volumes unchanged: the density needs no correction and stays exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.fit.normal_equations import normal_equations
from identification.fit.solve import Fit

__all__ = ["Ridge", "ridge_of"]

Array = NDArray[np.float64]

_REACH: Final = (1.0, 2.0, 3.0, 4.0, 5.0)
_STEPS: Final = 3
_PROBE: Final = 2.0
_BENT: Final = 0.5
_STIFF: Final = 1e8


@dataclass(frozen=True)
class Ridge:
    """A shear that makes a bent ridge straight.

    Args:
        centre: (n_parameter,) the optimum, search coordinates.
        along: (n_parameter,) the functional l that measures the way along the ridge, in standard
            deviations.
        way: (n_point,) ways at which the ridge was traced [-].
        shifts: (n_point, n_parameter) the ridge's distance from its tangent.
    """

    centre: Array
    along: Array
    way: Array
    shifts: Array

    def bent(self, straight: Array) -> Array:
        """Search coordinates (n_parameter, ...) of sheared ones."""
        return straight if self.way.size < 2 else np.asarray(straight + self._shift(straight))

    def straightened(self, bent: Array) -> Array:
        """Sheared coordinates (n_parameter, ...) of search coordinates; what `bent` takes back."""
        # The shear does not move a point along the ridge, l . s = 0.
        return bent if self.way.size < 2 else np.asarray(bent - self._shift(bent))

    def _shift(self, points: Array) -> Array:
        """How far the ridge is from its tangent where the points are."""
        way = np.tensordot(self.along, (points.T - self.centre).T, axes=1)
        inside = np.clip(way, self.way[0], self.way[-1])
        spline = CubicSpline(self.way, self.shifts, bc_type="natural")
        shift = spline(inside) + spline(inside, 1) * (way - inside)[..., None]
        return np.moveaxis(shift, -1, 0)


def ridge_of(fit: Fit) -> Ridge:
    """The ridge through the optimum along its least certain direction; straight where it is so."""
    covariance = fit.equations.covariance()
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    tangent = vectors[:, -1] * size * np.sqrt(values[-1])
    along = np.linalg.solve(covariance, tangent)
    along = along / float(along @ tangent)
    straight = Ridge(fit.position, along, np.zeros(1), np.zeros((1, size.size)))
    if not _is_bent(fit, tangent):
        return straight
    traced = {0.0: np.zeros(size.size)}
    for sign in (1.0, -1.0):
        before, position = fit.position - sign * tangent, fit.position
        states = list(fit.states)
        for reach in _REACH:
            # Straight on from the last two points of the ridge.
            found = _optimised(fit, 2 * position - before, states, along, sign * reach)
            if found is None:
                break
            before, (position, states) = position, found
            traced[sign * reach] = position - fit.position - sign * reach * tangent
    way = np.array(sorted(traced))
    return Ridge(fit.position, along, way, np.array([traced[w] for w in way]))


def _is_bent(fit: Fit, tangent: Array) -> bool:
    """Whether the cost two standard deviations away is not what a normal posterior has."""
    steps = np.array([_PROBE, -_PROBE])
    position = fit.position[:, None] + tangent[:, None] * steps
    moved = [fit.equations.state_response(k) @ tangent for k in range(len(fit.states))]
    states = [x[:, None] + m[:, None] * steps for x, m in zip(fit.states, moved, strict=True)]
    values = fit.coordinates.values(position)
    sums = fit.simulator.misfit(values, states, fit.weighting)
    here = fit.weighting.sized(sums)[1] - fit.coordinates.log_prior(position) - fit.cost
    return bool(np.any(np.abs(here - 0.5 * _PROBE**2) > _BENT))


def _optimised(
    fit: Fit, position: Array, states: list[Array], along: Array, way: float
) -> tuple[Array, list[Array]] | None:
    """The best point at a given way along the ridge; None where it leaves the bounds."""
    coordinates = fit.coordinates
    states = list(states)
    for _ in range(_STEPS):
        if np.any(position <= coordinates.lower) or np.any(position >= coordinates.upper):
            return None
        equations = normal_equations(fit.simulator, coordinates, position, states, fit.weighting)
        if not equations.is_finite:
            return None
        scale = float(np.max(np.diag(equations.matrix))) * _STIFF / float(along @ along)
        short = way - float(along @ (position - fit.position))
        matrix = equations.matrix + scale * np.outer(along, along)
        right = equations.gradient + scale * short * along
        size = np.sqrt(np.diag(matrix))
        step = np.linalg.lstsq(matrix / np.outer(size, size), right / size, rcond=1e-14)[0] / size
        position = position + step
        states = [
            x + np.linalg.solve(m, g - c @ step)
            for x, m, g, c in zip(
                states,
                equations.state_matrices,
                equations.state_gradients,
                equations.couplings,
                strict=True,
            )
        ]
        if not np.isfinite(position).all():
            return None
    return position, states
