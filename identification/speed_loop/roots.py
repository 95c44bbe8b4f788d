"""Roots of many real polynomials at once: balanced companion eigenvalues, Weierstrass iteration.

The eigenvalues of a companion matrix lose digits of the small roots of a polynomial whose roots
span many decades, as electrical and mechanical time constants may: up to 1e-10 of a root over
twelve decades, 5e-5 over 24.  Weierstrass's iteration (Durand-Kerner), Newton's method on all roots
together, restores them to 1e-14 within three steps.  Extended precision keeps sum and product of a
nearly double root, which single roots of double precision would lose.  A quadratic has a formula
without cancellation, a hundred times faster.

Sources: Kerner, Numerische Mathematik 8 (1966), 290-294 (Weierstrass iteration); Press et al.,
Numerical Recipes, 3rd edition, sections 5.6 (quadratic) and 9.5 (companion matrix).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.linear import eigenvalues

__all__ = ["monic_roots"]

Complex = NDArray[np.complex128]
Extended = NDArray[np.clongdouble]

_STEPS: Final = 3


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
