"""Shear that straightens a curved or truncated ridge of the posterior.

If runs determine products of parameters far better than the parameters themselves (for example, if
the back-EMF is weak compared with the friction), the posterior is a thin, curved ridge.  A sampler
with straight proposals moves slowly along it.  The ridge is therefore traced by optimising all
other directions at a sequence of positions, by constrained Gauss-Newton: among the few least
certain directions and the inward direction from each active bound, along the one in which the
posterior is least normal, which means curved, truncated by a bound, or long-tailed.  The posterior
is sampled in coordinates sheared along it,

    z = w + s(t(w)),      t(w) = l . (w - z_0),      l . s = 0,

which preserve volume: the density needs no Jacobian and stays exact.  The best initial states of
the records are tabulated along the ridge as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import null_space

from identification.arrays import Array, Bool
from identification.fit.normal_equations import NormalEquations, normal_equations
from identification.fit.solve import Fit
from identification.linear import eigh, least_squares, solution

__all__ = ["Ridge", "ridge_of"]


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
        """True if the ridge needs no shear."""
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


_STEP: Final = 0.5
_LONGER: Final = 1.5
_GENTLE: Final = 0.5
"""`_STEP`: distance to the first point [standard deviations].  `_LONGER`: growth of the distance
after a point at which the log density dropped by less than `_GENTLE`."""
_MOST: Final = 14
_ENOUGH: Final = 9.0
"""`_MOST`: largest number of points on one side.  `_ENOUGH`: drop of the log density beyond which
nothing is sampled."""
_STEPS: Final = 5
_FAR: Final = 0.1
"""Squared Gauss-Newton step [squared standard deviations] below which a point is on the ridge."""
_DIRECTIONS: Final = 3
_PROBE: Final = 2.0
_BENT: Final = 0.5
_CUT: Final = 2.0
"""Deviation from normality assigned to a density that a bound truncates at the probe."""
_STIFF: Final = 1e8


@dataclass(frozen=True)
class _Point:
    """A point of the ridge."""

    position: Array
    """(n_parameter,) search coordinates."""
    states: tuple[Array, ...]
    """For each record (n_state,) the best initial state."""
    precision: Array
    """(n_parameter, n_parameter) inverse covariance at the point."""
    drop: float
    """Drop of the log density from the optimum."""


@dataclass(frozen=True)
class _Direction:
    """A candidate direction of the ridge."""

    tangent: Array
    """(n_parameter,) step over which the log density falls by about one half."""
    functional: Array
    """(n_parameter,) linear functional l that gives the position; l . tangent = 1."""
    free: Bool
    """(n_parameter,) whether a parameter moves; the others stay at their bounds."""


def ridge_of(fit: Fit, fraction: float) -> Ridge:
    """The ridge through the optimum of a fit; straight if the posterior is close to normal."""
    directions = _directions(fit, fraction)
    excess = _excess(fit, fraction, directions)
    direction = directions[int(np.argmax(excess))]
    points = {0.0: _Point(fit.position, fit.states, fit.equations.precision(fraction), 0.0)}
    if excess.max() > _BENT:
        for sign in (1.0, -1.0):
            points |= _traced(fit, fraction, direction, sign)
    return _ridge(fit, direction, points)


def _directions(fit: Fit, fraction: float) -> list[_Direction]:
    """The least certain directions, and the inward direction from each active bound."""
    coordinates, precision = fit.coordinates, fit.equations.precision(fraction)
    lower, upper = fit.position <= coordinates.lower, fit.position >= coordinates.upper
    free = ~(lower | upper)
    root = _scaled_root(precision[np.ix_(free, free)])
    size = np.sqrt(np.sum(root**2, axis=1))
    values, vectors = eigh(root @ root.T / np.outer(size, size))
    found = []
    for k in range(size.size - 1, max(size.size - 1 - _DIRECTIONS, -1), -1):
        tangent = np.zeros(free.size)
        tangent[free] = vectors[:, k] * np.sqrt(values[k]) * size
        functional = precision @ tangent
        found.append(_Direction(tangent, functional / float(functional @ tangent), free))
    for bound in np.flatnonzero(~free):
        moving = free.copy()
        moving[bound] = True
        root = _scaled_root(precision[np.ix_(moving, moving)])
        deviation = (root @ root.T)[:, np.flatnonzero(moving) == bound][:, 0]
        tangent = np.zeros(free.size)
        tangent[moving] = deviation / np.sqrt(deviation[np.flatnonzero(moving) == bound])
        tangent = tangent if lower[bound] else -tangent
        # At a bound the gradient lowers the density sooner than the curvature does.
        slope = max(-float(fit.equations.gradient @ tangent), 0.0)
        tangent = tangent / (np.hypot(slope, 1.0) + slope)
        functional = np.zeros(free.size)
        functional[bound] = 1.0 / tangent[bound]
        found.append(_Direction(tangent, functional, moving))
    kept = [d for d in found if np.isfinite(d.tangent).all() and np.isfinite(d.functional).all()]
    # If the precision is numerically singular, the direction is arbitrary and not followed.
    first = np.eye(free.size)[0]
    return kept or [_Direction(first, first, free)]


def _excess(fit: Fit, fraction: float, directions: list[_Direction]) -> Array:
    """(n_direction,) deviation of the log density from normality, two standard deviations away."""
    count = len(directions)
    tangents = _PROBE * np.array([direction.tangent for direction in directions]).T
    steps = np.hstack([tangents, -tangents])
    position = fit.position[:, None] + steps
    states = [
        start[:, None] + fit.equations.state_response(k) @ steps
        for k, start in enumerate(fit.states)
    ]
    falls = _falls(fit, fraction, position, states)
    excess = np.abs(falls - 0.5 * _PROBE**2)
    excess = np.where(np.isinf(fit.coordinates.log_prior(position)), _CUT, excess)
    excess = np.where(np.isfinite(excess), excess, np.inf)
    return np.asarray(np.maximum(excess[:count], excess[count:]))


def _falls(fit: Fit, fraction: float, position: Array, states: list[Array]) -> Array:
    """(n_point,) drop of the log density from the optimum."""
    points = np.column_stack([fit.position, position])
    starts = [np.column_stack([own, x]) for own, x in zip(fit.states, states, strict=True)]
    sums = fit.simulator.misfit(fit.coordinates.values(points), starts, fit.weighting)
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = 0.5 * np.sum(sums / fit.weighting.deviation[:, None] ** 2, axis=0)
        height = fit.coordinates.log_prior(points) - fraction * misfit
        return np.asarray(height[0] - height[1:])


def _traced(fit: Fit, fraction: float, direction: _Direction, sign: float) -> dict[float, _Point]:
    """Points of the ridge on one side, by position."""
    found: dict[float, _Point] = {}
    abscissa, step = 0.0, _STEP
    slope = direction.tangent
    here = _Point(fit.position, fit.states, fit.equations.precision(fraction), 0.0)
    while len(found) < _MOST and here.drop < _ENOUGH:
        abscissa += sign * step
        # Extrapolate from the last two points of the ridge.
        ahead = here.position + sign * step * slope
        point = _constrained_optimum(fit, fraction, ahead, here.states, direction, abscissa)
        if point is None or not point.drop < 2.0 * _ENOUGH:
            break
        slope = (point.position - here.position) / (sign * step)
        # Longer steps reach the end of a long tail.
        step *= _LONGER if point.drop - here.drop < _GENTLE else 1.0
        here = found[abscissa] = point
    return found


def _constrained_optimum(
    fit: Fit,
    fraction: float,
    position: Array,
    states: tuple[Array, ...],
    direction: _Direction,
    abscissa: float,
) -> _Point | None:
    """The best point at a position along the ridge; None if none is found inside the bounds."""
    coordinates, free = fit.coordinates, direction.free
    for _ in range(_STEPS):
        if not _is_inside(fit, position, free):
            return None
        equations = normal_equations(fit.simulator, coordinates, position, states, fit.weighting)
        if not equations.is_finite:
            return None
        precision = equations.precision(fraction)
        short = abscissa - float(direction.functional @ (position - fit.position))
        step = np.zeros_like(position)
        step[free] = _step(equations, direction.functional, short, free)
        far = float(step @ precision @ step)
        position = position + step
        states = tuple(
            x + solution(m, g - c @ step)
            for x, m, g, c in zip(
                states,
                equations.state_matrices,
                equations.state_gradients,
                equations.couplings,
                strict=True,
            )
        )
        if far < _FAR and _is_inside(fit, position, free):
            # The precision is unchanged by so short a step.
            fall = _falls(fit, fraction, position[:, None], [x[:, None] for x in states])
            return _Point(position, states, precision, float(fall[0]))
    return None


def _is_inside(fit: Fit, position: Array, free: Bool) -> bool:
    lower, upper = fit.coordinates.lower, fit.coordinates.upper
    return bool(np.all(((position > lower) & (position < upper))[free]))


def _step(equations: NormalEquations, functional: Array, short: float, free: Bool) -> Array:
    """Gauss-Newton step of the free parameters to the best point, `short` along the ridge."""
    matrix, gradient = equations.matrix[np.ix_(free, free)], equations.gradient[free]
    functional = functional[free]
    scale = float(np.max(np.diag(matrix))) * _STIFF / float(functional @ functional)
    matrix = matrix + scale * np.outer(functional, functional)
    right = gradient + scale * short * functional
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return least_squares(matrix / np.outer(size, size), right / size, 1e-14) / size


def _ridge(fit: Fit, direction: _Direction, points: dict[float, _Point]) -> Ridge:
    """The ridge of the traced points, in the order of their positions."""
    tangent, functional = direction.tangent, direction.functional
    abscissae = np.array(sorted(points))
    traced = [points[abscissa] for abscissa in abscissae]
    moved = np.array([point.position - fit.position for point in traced])
    states = tuple(
        np.array([point.states[k] for point in traced])
        - start
        - moved @ fit.equations.state_response(k).T
        for k, start in enumerate(fit.states)
    )
    basis = null_space(functional[None, :] / np.linalg.norm(functional))
    roots, log_density = [], []
    for point in traced:
        root = _scaled_root(basis.T @ point.precision @ basis)
        roots.append(root)
        log_density.append(float(np.sum(np.log(np.diag(root)))) - point.drop)
    return Ridge(
        centre=fit.position,
        tangent=tangent,
        functional=functional,
        abscissae=abscissae,
        shifts=moved - np.outer(abscissae, tangent),
        states=states,
        log_density=np.array(log_density),
        roots=np.array(roots),
        basis=basis,
    )


def _scaled_root(precision: Array) -> Array:
    """Cholesky factor of the inverse of a precision matrix, computed at unit diagonal."""
    size = np.sqrt(np.maximum(np.diag(precision), 1e-300))
    values, vectors = eigh(precision / np.outer(size, size))
    upper = np.linalg.qr((vectors / np.sqrt(np.maximum(values, 1e-14))).T, mode="r")
    return np.asarray((upper * np.sign(np.diag(upper))[:, None]).T / size[:, None])
