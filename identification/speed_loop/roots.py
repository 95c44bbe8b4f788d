"""Roots of many functions at once: of real polynomials, and of any function in brackets.

Polynomials: the eigenvalues of a balanced companion matrix lose digits of the small roots of a
polynomial whose roots span many decades, as electrical and mechanical time constants may: up to
1e-10 of a root over twelve decades, 5e-5 over 24.  Weierstrass's iteration (Durand-Kerner),
Newton's method on all roots together, restores them to 1e-14 within three steps.  Extended
precision keeps sum and product of a nearly double root, which single roots of double precision
would lose.  A quadratic has a formula without cancellation, a hundred times faster.

Brackets: a step of Chandrupatla's method interpolates the inverse quadratically if three points
near the root are well placed, and bisects otherwise.

Sources: Kerner, Numerische Mathematik 8 (1966), 290-294 (Weierstrass iteration); Press et al.,
Numerical Recipes, 3rd edition, sections 5.6 (quadratic) and 9.5 (companion matrix); Chandrupatla,
Advances in Engineering Software 28 (1997), 145-149.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Complex, Index
from identification.linear import eigenvalues

__all__ = ["monic_roots", "root"]

Extended = NDArray[np.clongdouble]

_STEPS: Final = 3
_EPS, _TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)
_MOST_STEPS: Final = 2046
"""Bisections from the largest to the smallest normal number."""


def monic_roots(coefficients: Array) -> Complex:
    """Roots (n_polynomial, degree) of monic polynomials (n_polynomial, degree + 1), falling powers.

    Real roots by rising real part, then conjugate pairs by falling real part, the positive
    imaginary part first.
    """
    degree = coefficients.shape[1] - 1
    if degree == 2:
        return _quadratic_roots(coefficients[:, 1], coefficients[:, 2])
    companion = np.zeros((coefficients.shape[0], degree, degree))
    companion[:, 0] = -coefficients[:, 1:]
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    roots = _polished(coefficients, eigenvalues(companion))
    is_complex = roots.imag != 0
    rising = np.where(is_complex, -roots.real, roots.real)
    order = np.lexsort((-roots.imag, np.abs(roots.imag), rising, is_complex), axis=1)
    return np.asarray(np.take_along_axis(roots, order, axis=1))


def _quadratic_roots(total: Array, product: Array) -> Complex:
    """Roots of s^2 + total s + product, (n_polynomial, 2)."""
    half = total / 2
    with np.errstate(over="ignore"):
        discriminant = half**2 - product
    radius = np.sqrt(np.abs(discriminant))
    far = -(half + np.copysign(radius, half))
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(far == 0, 0.0, product / far)
    is_real = discriminant >= 0
    first = np.where(is_real, np.minimum(far, near) + 0j, -half + 1j * radius)
    second = np.where(is_real, np.maximum(far, near) + 0j, -half - 1j * radius)
    return np.stack([first, second], axis=-1)


@np.errstate(all="ignore")
def _polished(coefficients: Array, estimates: Complex) -> Complex:
    """Weierstrass steps z_i - p(z_i) / prod (z_i - z_j), each accepted if it fits p better."""
    roots: Extended = estimates.astype(np.clongdouble)
    itself = np.eye(roots.shape[1], dtype=bool)
    # LAPACK returns conjugates side by side, the positive imaginary part first.
    lower = np.nonzero(roots.imag < 0)
    error = _backward_error(coefficients, roots)
    for _ in range(_STEPS):
        value = np.zeros_like(roots)
        for coefficient in coefficients.T:
            value = value * roots + coefficient[:, None]
        gaps = np.where(itself, 1.0, roots[:, :, None] - roots[:, None, :])
        moved = roots - value / gaps.prod(axis=2)
        moved = np.where(roots.imag == 0, moved.real, moved)
        moved[lower] = np.conj(moved[lower[0], lower[1] - 1])
        left = _backward_error(coefficients, moved)
        better = left < error
        roots, error = np.where(better[:, None], moved, roots), np.where(better, left, error)
    return roots.astype(np.complex128)


def _backward_error(coefficients: Array, roots: Extended) -> NDArray[np.longdouble]:
    """Largest relative distance of the coefficients from those of prod (s - z_i), (n_polynomial,).

    Each distance is relative to the same coefficient of prod (s + |z_i|).
    """
    product = np.zeros(coefficients.shape, dtype=np.clongdouble)
    scale = np.zeros(coefficients.shape, dtype=np.longdouble)
    product[:, 0] = scale[:, 0] = 1.0
    for root in roots.T:
        product[:, 1:] -= root[:, None] * product[:, :-1]
        scale[:, 1:] += np.abs(root)[:, None] * scale[:, :-1]
    distance = np.abs(product - coefficients)
    return np.asarray(np.where(distance == 0, 0.0, distance / scale).max(axis=1))


def root(
    function: Callable[..., Array], bracket: tuple[Array, Array], args: tuple[Array | Index, ...]
) -> Array:
    """Roots (n_root,) between two ends to machine precision; NaN where the sign does not change.

    The function is called with (n,) abscissae and the same rows of each of `args`.
    """
    found = np.full(bracket[0].size, np.nan)
    if not found.size:
        return found
    rows = np.arange(found.size)
    # A difference may overflow or be zero; the step is then a bisection.
    with np.errstate(all="ignore"):
        (x1, f1), (x2, f2) = ((x, function(x, *args)) for x in bracket)
        x3, f3, share = x2, f2, np.full(x1.size, 0.5)
        for step in range(_MOST_STEPS):
            nearest = np.where(np.abs(f1) < np.abs(f2), x1, x2)
            width, tolerance = np.abs(x2 - x1), 4 * (np.abs(nearest) * _EPS + _TINY)
            is_root = np.minimum(np.abs(f1), np.abs(f2)) <= _TINY
            is_bracket = (np.sign(f1) * np.sign(f2) < 0) & np.isfinite(width)
            found[rows] = np.where(is_root | is_bracket, nearest, np.nan)
            going = np.flatnonzero(is_bracket & ~is_root & (width >= tolerance))
            if not going.size:
                break
            if going.size < rows.size:
                rows, args = rows[going], tuple(each[going] for each in args)
                x1, x2, x3, f1, f2, f3 = (each[going] for each in (x1, x2, x3, f1, f2, f3))
                share = share[going]
            if step:
                least = 0.5 * (tolerance / width)[going]
                share = np.clip(_interpolated((x1, x2, x3), (f1, f2, f3)), least, 1 - least)
            x = x1 + share * (x2 - x1)
            f = function(x, *args)
            same = np.sign(f) == np.sign(f1)
            x1, x2, x3 = x, np.where(same, x2, x1), np.where(same, x1, x2)
            f1, f2, f3 = f, np.where(same, f2, f1), np.where(same, f1, f2)
    return found


def _interpolated(x: tuple[Array, Array, Array], f: tuple[Array, Array, Array]) -> Array:
    """Share of the way from x1 to x2: inverse quadratic interpolation, or one half."""
    (x1, x2, x3), (f1, f2, f3) = x, f
    place, value = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
    along = (x3 - x1) / (x2 - x1)
    quadratic = f1 / (f1 - f2) * f3 / (f3 - f2) - along * f1 / (f3 - f1) * f2 / (f2 - f3)
    is_monotone = (1 - np.sqrt(1 - place) < value) & (value < np.sqrt(place))
    return np.where(is_monotone, quadratic, 0.5)
