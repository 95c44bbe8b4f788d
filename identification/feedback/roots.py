"""Roots of many real polynomials of degree two or three at once.

The eigenvalues of a companion matrix lose the small roots of a polynomial whose roots span ten
decades, as electrical and mechanical time constants may.  Here they are starting values only.
Newton's method refines one real root, deflation in the stable direction (forward or backward)
divides it out, and a formula without cancellation solves the remaining quadratic.

Source: Press et al., Numerical Recipes, 3rd edition, sections 5.6 (quadratic) and 9.5 (forward
and backward deflation).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.linear import eigenvalues

__all__ = ["monic_roots", "quadratic_roots"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_POLISHING_STEPS: Final = 4


def monic_roots(coefficients: Array) -> Complex:
    """Roots of monic polynomials.

    Args:
        coefficients: (n_polynomial, degree + 1), falling powers, the first 1, degree 2 or 3.

    Returns:
        (n_polynomial, degree).  The last two roots are a pair: complex conjugates, positive
        imaginary part first, or real, the larger first.  The first root of a cubic is real.
    """
    if coefficients.shape[1] == 3:
        return quadratic_roots(coefficients[:, 1], coefficients[:, 2])
    first = _one_real_root(coefficients)
    _, c2, c1, c0 = coefficients.T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        product = -c0 / first
        backward = (product - c1) / first
    # Forward deflation by a large root, or backward deflation by a small one, is unstable.
    is_large = np.abs(first) ** 3 > np.abs(c0)
    total = np.where(is_large & np.isfinite(backward), backward, c2 + first)
    product = np.where(first == 0, c1, product)
    return np.concatenate([first[:, None] + 0j, quadratic_roots(total, product)], axis=1)


def quadratic_roots(total: Array, product: Array) -> Complex:
    """Roots of s^2 + total s + product, in the order of `monic_roots`.

    Args:
        total: (n_polynomial,) minus the sum of the roots.
        product: (n_polynomial,) product of the roots.
    """
    half = total / 2
    with np.errstate(over="ignore"):
        discriminant = half**2 - product
    radius = np.sqrt(np.abs(discriminant))
    far = -(half + np.copysign(radius, half))
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(far == 0, 0.0, product / far)
    is_real = discriminant >= 0
    upper = np.where(is_real, np.maximum(far, near) + 0j, -half + 1j * radius)
    lower = np.where(is_real, np.minimum(far, near) + 0j, -half - 1j * radius)
    return np.stack([upper, lower], axis=-1)


def _one_real_root(coefficients: Array) -> Array:
    """Real root of each cubic to machine precision, the largest in magnitude if there are three."""
    _, c2, c1, c0 = coefficients.T
    companion = np.zeros((c0.size, 3, 3))
    companion[:, 0] = -coefficients[:, 1:]
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    candidates = eigenvalues(companion)
    size = np.where(candidates.imag == 0, np.abs(candidates), -1.0)
    root = candidates[np.arange(c0.size), size.argmax(axis=1)].real
    with np.errstate(over="ignore", invalid="ignore"):
        residual = ((root + c2) * root + c1) * root + c0
    for _ in range(_POLISHING_STEPS):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            moved = root - residual / ((3 * root + 2 * c2) * root + c1)
            left = ((moved + c2) * moved + c1) * moved + c0
        better = np.abs(left) < np.abs(residual)
        root, residual = np.where(better, moved, root), np.where(better, left, residual)
    return np.asarray(root)
