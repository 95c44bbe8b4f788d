"""Dense linear algebra that returns NaN where there is no solution, instead of raising.

A candidate of a search may diverge; its normal equations are then singular or not finite.  LAPACK
raises or hangs on some of these, depending on the last digit.  Here every such system has the
solution NaN.  The caller's cost becomes NaN, and the comparison of models rejects the candidate.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from identification.arrays import Array, Complex

__all__ = ["eigenvalues", "eigh", "least_squares", "root", "solution"]


def solution(matrix: Array, right: Array) -> Array:
    """Solution of a square system with (n,) or (n, n_column) right sides; NaN if it has none."""
    if np.isfinite(matrix).all():
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    return np.full_like(right, np.nan, dtype=np.float64)


def least_squares(matrix: Array, right: Array, rcond: float | None = None) -> Array:
    """Minimum-norm least-squares solution; all NaN if the system is not finite.

    Singular values below the fraction `rcond` of the largest count as zero [-].
    """
    if np.isfinite(matrix).all() and np.isfinite(right).all():
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.lstsq(matrix, right, rcond=rcond)[0], dtype=np.float64)
    return np.full((matrix.shape[1], *right.shape[1:]), np.nan)


def eigh(matrix: Array) -> tuple[Array, Array]:
    """Ascending eigenvalues, and eigenvectors, of symmetric (..., n, n); NaN if not finite."""
    if np.isfinite(matrix).all():
        with suppress(np.linalg.LinAlgError):
            values, vectors = np.linalg.eigh(matrix)
            return np.asarray(values, dtype=np.float64), np.asarray(vectors, dtype=np.float64)
    return np.full(matrix.shape[:-1], np.nan), np.full(matrix.shape, np.nan)


def eigenvalues(matrices: Array) -> Complex:
    """Eigenvalues of general (..., n, n) matrices; NaN for each matrix that is not finite."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
    values = np.linalg.eigvals(np.where(finite[..., None, None], matrices, 0.0))
    return np.asarray(np.where(finite[..., None], values, np.nan), dtype=np.complex128)


def root(covariance: Array) -> Array:
    """Square root A with A A' = `covariance`, (n, n): by Cholesky, else by eigenvalues.

    The covariance is positive semi-definite up to rounding.
    """
    if np.isfinite(covariance).all():
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    values, vectors = eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.float64)
