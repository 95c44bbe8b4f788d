"""Consider covariance of the detail that the spline of a curve cannot represent.

A spline with few knots approximates the law of the motor; the kink of a dead zone, for example, is
rounded off.  Nothing of that is visible in the residual, but the error follows the inputs, and the
parameters absorb it.

The detail between two knots is a bump b with unknown height u.  If the law is an integrated Wiener
process, whose estimate is the cubic smoothing spline, it is known at the knots with value and
slope, and with a standard normal number z

    b(t) = 16 t^2 (1 - t)^2,      u = z sqrt(q h^3 / 192),      E (f'' h^2)^2 = sqrt(3) q h^3

where t is 0 and 1 at the knots, h their distance and f'' the second derivative of the interpolating
spline at a knot.  The fitted curve gives q, at both knots of each bump.  A law with kinks is
rougher between the knots than that; if the residual r requires it, all heights are larger by a
factor, that of the largest marginal likelihood.  With the responses D to the bumps, projected on
the complement of the parameters, and the prior S of the heights,

    u | r = N(m, P),      P = (D'WD + S^-1)^-1,      m = P D'W r

The parameters change with u to first order.  Both the mean and the covariance of u join the
intervals, since the fit itself is not moved.

Source: Wahba, J. Royal Statistical Society B 40 (1978), 364-372 (smoothing spline as the mean of an
integrated Wiener process); Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider
covariance).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.solve import Fit
from identification.linear import root, solution
from identification.selection.forcing import responses, trajectory
from identification.selection.omitted import OmittedTerm, independent
from identification.selection.policy import DEFAULT
from identification.selection.projection import Residual
from identification.surrogates.curve import HEIGHTS, AbstractCurve

__all__ = ["bumps", "curve_details", "DETAIL_RATIO"]

_SPANS: Final = HEIGHTS - 3
"""Intervals between the knots inside the range of a curve."""
DETAIL_RATIO: Final = 1.0 / (192.0 * np.sqrt(3.0))
"""Mean square of the height of a bump over that of f'' h^2 [-]."""
_FACTORS: Final = 2.0 ** np.arange(0.0, 8.5, 0.5)
"""Factors on the heights among which the likelihood selects [-]."""


def curve_details(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes by the detail of the curves of a fit; empty without a curve.

    `fraction` is the effective sample fraction of the fit [-].  A curve over the shaft angle is a
    Fourier series and has no such detail.
    """
    found: list[OmittedTerm] = []
    for term in fit.simulator.model.terms:
        if isinstance(term, AbstractCurve) and term.along != "position":
            found += _details_of(fit, term, fraction)
    return tuple(found)


def _details_of(fit: Fit, term: AbstractCurve, fraction: float) -> tuple[OmittedTerm, ...]:
    heights = _heights(fit, term)
    row = 0 if term.equation == "electrical" else 1

    def forces(k: int) -> Array:
        record, current, speed = trajectory(fit, k)
        signal, carrier = term.drawn(record, current, speed)
        force = np.zeros((record.rows, 2, _SPANS))
        place = (signal - term.lower) / (term.upper - term.lower) * _SPANS
        force[:, row] = -heights * bumps(place) * carrier[:, None]
        return force

    residual = Residual.of(fit, DEFAULT.screening_samples)
    projection = residual.project(responses(fit, forces, residual.stride), _SPANS)
    information = fraction * projection.products
    squares = _second_moments(information, fraction * projection.onto_residual)
    return independent(fit, fraction, "curve_detail", projection.along.position @ root(squares))


def _second_moments(information: Array, right: Array) -> Array:
    """E(z z') of standard normal numbers z, given the residual, (n, n) [-].

    The information of the data on z is (n, n), the right-hand side (n,).  The numbers have a common
    factor, at least one, with the largest marginal likelihood.
    """
    found, best = np.full_like(information, np.nan), -np.inf
    for factor in _FACTORS:
        precision = information + np.eye(right.size) / factor**2
        mean = solution(precision, right)
        determinant = np.linalg.slogdet(factor**2 * precision)[1]
        evidence = 0.5 * float(right @ mean - determinant)
        if evidence > best:
            best = evidence
            found = solution(precision, np.eye(right.size)) + np.outer(mean, mean)
    return found


def _heights(fit: Fit, term: AbstractCurve) -> Array:
    """(n_span,) standard deviation of the height of each bump [V] or [N m]."""
    bends = np.diff(term.kept @ term.heights(fit.by_name), n=2) ** 2
    return np.asarray(np.sqrt(0.5 * DETAIL_RATIO * (bends[:-1] + bends[1:])))


def bumps(place: Array) -> Array:
    """(n_sample, n_span) bumps of unit height; places (n_sample,) are in spans from the start."""
    inside = np.clip(place[:, None] - np.arange(_SPANS), 0.0, 1.0)
    return np.asarray(16.0 * inside**2 * (1.0 - inside) ** 2)
